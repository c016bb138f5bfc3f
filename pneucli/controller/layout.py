"""Where each number stands in the controller's two arrays: its state and its parameters."""

from __future__ import annotations

TABLE_NODES = 201  # of each inverse table
STROKE_NODES = 101  # of each table along the stroke
DELAY_LINE_SAMPLES = (
    64  # samples that are remembered, of what is under way in the hose and of what late sensors should read
)
OPEN_CHAMBER_VOLUME = (
    1e3  # m^3: an open chamber 2 is a closed one of this size, whose pressure stays that of the surroundings
)

(
    S_STARTED,  # 1 after the first sample
    S_U1,  # V, the commands of this sample
    S_U2,
    S_X,  # m, m/s: observed motion
    S_V,
    S_LOAD,  # N: filtered estimate of what pushes beside the pressures and the modelled friction
    S_P1,  # Pa: observed pressures
    S_P2,
    S_RATE1,  # Pa/s: what the last command should make of the pressures
    S_RATE2,
    S_FLOW1,  # Pa/s: filtered estimate of what changes the pressures beside that
    S_FLOW2,
    S_X_REF,  # m: last reference, its last rate and its filtered rate in m/s, how that changes in m/s^2
    S_RAW_RATE,
    S_V_REF,
    S_A_REF,
    S_X_SHAPED,  # m, m/s, m/s^2: the reference that the axis is able to follow
    S_V_SHAPED,
    S_A_SHAPED,
    S_REF_REST_TIME,  # s since the reference came to rest
    S_HOLD,  # 1 while the piston is left where it sticks
    S_ANCHOR,  # m: where the piston lately was, and samples since it began to stir from there
    S_MOVING_COUNT,
    S_REST_TIME,  # s for which it had not stirred before it last began to
    S_BREAKAWAY_FORCE,  # N beyond the load that last set it free, and that is applied to do so
    S_RELEASE_FORCE,
    S_LAST_SIGN,  # sign of the error; share of the pace that is left after going too far (above 1: all)
    S_RAMP_GAIN,
    S_BRAKING_TIME,  # s for which a freed piston is still stopped
    S_ELASTIC,  # 1: the piston was seen to give way to a force that friction surely holds
    S_EXCURSION,  # m that it went since it last turned or rested, and the most in N that pushed it along meanwhile
    S_PEAK_FORCE,
    S_LOOP_GAIN,  # 1: share of the loop's firmness that is left after it swung on its seals
    S_FORCE_RAMP,  # N by which the force on an elastic piston has risen since it sticks
    S_DEADBAND_GAIN,  # 1: over the reach, the error that is put up with after going too far
    S_BREAKAWAY_POSITION,  # m: where the piston was last set free, and how far it went the time before
    S_LAST_JUMP,
    S_FORCE,  # N asked of the pressures, and what of it is integrated
    S_INTEGRAL,
    S_P1_REF,  # Pa
    S_P2_REF,
    S_INTEGRAL1,  # Pa/s
    S_INTEGRAL2,
    S_SUPPLY,  # Pa: measured supply pressure, 0 where it is not
    S_DISABLED,  # 1: not enabled
    S_HOLD_REQUEST,  # 1: to hold where it stands, 2: it does so; and where, m or Pa
    S_HOLD_REFERENCE,
    S_RESET_PHASE,  # 2: to start from its next readings, 1: its next command is the one it starts from
    S_BUMPLESS_OFFSET1,  # V by which its commands are off for that, fading
    S_BUMPLESS_OFFSET2,
    S_PLAY1,  # V: where the plays and the spools of the valves stand
    S_PLAY2,
    S_SPOOL1,
    S_SPOOL2,
    S_SENSOR_P1,  # Pa: what lagging sensors should see
    S_SENSOR_P2,
    S_PREDICTED_X,  # m, m/s, Pa: motion and pressures when what is commanded now arrives
    S_PREDICTED_V,
    S_PREDICTED_P1,
    S_PREDICTED_P2,
    S_LINE_INDEX,  # place of all rows where the latest stands
    S_LEVEL,  # Pa: mean of both pressures that is kept, on its way to what is asked for; 0: not yet begun
    S_LEVEL_SET,  # Pa: what it was set to, 0: as designed
) = range(63)

# states of LINE numbers each stand behind: rings of openings in V and of pressures seen in Pa
S_OPENING_LINE1, S_OPENING_LINE2, S_PRESSURE_LINE1, S_PRESSURE_LINE2 = (63 + i * DELAY_LINE_SAMPLES for i in range(4))

(
    C_PERIOD,  # s
    C_U_MAX,  # V
    C_TWO_VALVES,  # 1: a second valve drives chamber 2
    C_MIRRORED,  # 1: the other way of the one spool does (5/3)
    C_FEEDFORWARD,  # 1: what is known goes ahead: mass and friction on the reference's way, the piston's motion
    C_DISTURBANCE_OBSERVERS,  # 1: both disturbance estimates are subtracted, 0: the errors are integrated instead
    C_HOLD,  # 1: near a resting reference the piston is left where it sticks, the valve shut
    C_SWITCHING,  # 1: off it, the sector's switching term frees a piston that sticks
    C_INVERSE_MAP,  # 1: commands by the inverse of the valve's map, 0: in proportion to the gradient
    C_PRESSURE_MODE,  # 1: the reference is the pressure of chamber 1 in Pa, and the pressure loop is all there is
    C_MASS,  # kg, m^2, m, m^3
    C_AREA_1,
    C_AREA_2,
    C_STROKE,
    C_DEAD_VOLUME_1,
    C_DEAD_VOLUME_2,
    C_AMBIENT,  # Pa
    C_SUPPLY,
    C_GAMMA,  # 1
    C_GAMMA_R_T,  # J/kg
    C_K_GAS,  # sqrt(2 / (R T)), s/m
    C_CRITICAL_RATIO,  # 1
    C_COULOMB,  # N, N, m/s, N s/m
    C_STATIC,
    C_STRIBECK,
    C_VISCOUS,
    C_VISCOUS_BACK,  # N s/m toward x = 0
    C_DECELERATION_RATIO,  # 1: dry friction while slowing, over Coulomb's
    C_DRY_P1,  # 1/Pa: by which dry friction grows with the pressures above ambient
    C_DRY_P2,
    C_V_FLOOR,  # m/s below which the direction of motion is not known
    C_V_MAX,  # limits of the shaped reference: m/s, m/s^2, and the time in s over which it closes in
    C_A_MAX,
    C_SHAPING_TIME,
    C_FRICTION_LEAD,  # s by which friction ahead leads: what the pressure loop takes
    C_KP,  # 1/s^2, 1/s, 1/s^3
    C_KD,
    C_KI,
    C_SECTOR_1,  # 1/s: the sector's lines
    C_SECTOR_2,
    C_RAMP_RATE_PER_ERROR,  # N/(s m), N/s, N/s: integral switching term
    C_RAMP_RATE_MIN,
    C_RAMP_RATE_MAX,
    C_BREAKAWAY_MAX,  # N: the most that the piston is expected to be held by after a short rest
    C_PRESLIDING_DISTANCE,  # m after which a piston surely slides, whatever is elastic in its seals
    C_RAMP_GROWTH_RATE,  # 1/s by which the force on an elastic piston that sticks grows
    C_RELEASE_FORCE_MAX,  # N: largest force that shall free a piston
    C_UNLOADING_RATE,  # 1/s by which a force grows that stops one which does not stop by itself
    C_CLOSING_RATE,  # 1/s by which it closes in
    C_BRAKE_DAMPING,  # N s/m that stops it near its reference
    C_DEADBAND_GAIN_MAX,  # 1: over the reach, the largest error that is put up with
    C_MOTION_WINDOW,  # s in which a stirring piston is noticed and stopped
    C_HOLDING_BAND,  # m: error at which the piston is left in peace
    C_OBS_X,  # 1, 1/s, N/m: gains of the motion observer for the innovation of position
    C_OBS_V,
    C_OBS_LOAD,
    C_LOAD_STEP_MAX,  # N: largest change of the load estimate in a sample (M_k)
    C_P_KP,  # 1/s, 1/s^2
    C_P_KI,
    C_OBS_SENSOR,  # 1, 1, 1/s: gains of the pressure observers
    C_OBS_P,
    C_OBS_FLOW,
    C_FLOW_STEP_MAX,  # Pa/s: largest change of the flow estimate in a sample (M_k)
    C_PRESSURE_BAND,  # Pa off its reference that a pressure may be while the piston is held
    C_P_LOW,  # Pa: range of the pressure references
    C_P_HIGH,
    C_P_MEAN,  # Pa: mean of both pressures, where there are two valves
    C_AIR_STIFFNESS,  # N/m that sets the mean pressure, 0: it is C_P_MEAN; the most in Pa/s by which it changes
    C_LEVEL_RATE,
    C_AREA_FILL,  # m^2: largest effective areas of the paths of chamber 1, and of chamber 2
    C_AREA_VENT,
    C_AREA_FILL_2,
    C_AREA_VENT_2,
    C_SPOOL_SHARE,  # 1: share of its way that a spool goes in a sample, in the mean over it, and that it is asked to go
    C_SPOOL_MEAN_SHARE,
    C_SPOOL_LEAD,
    C_PLAY,  # V: half of the play between command and spool, and what of its way is left alone
    C_PLAY_DEADBAND,
    C_FLOW_DELAY,  # samples between spool and chamber
    C_SENSOR_SHARE,  # 1: share of its way that a pressure sensor goes in a sample; samples by which it is read late
    C_SENSOR_DELAY,
    C_SCALE_1,  # 1, Pa: readings of p1 and p2 are scale p + zero
    C_SCALE_2,
    C_OFFSET_1,
    C_OFFSET_2,
    C_LEAK_1,  # m^2: leaks of the chambers to ambient, between them, of the valve
    C_LEAK_2,
    C_LEAK_12,
    C_LEAK_VALVE,
    C_STROKE_NODES,  # of each table along the stroke, which follow the inverse ones
    C_TABLE_NODES,  # of each inverse table; they follow: commands in V at (i / (nodes - 1))^2 of the largest area,
    # filling and venting chamber 1, then chamber 2
    C_TABLE,
) = range(92)

_DELAY_LINES = ("S_OPENING_LINE1", "S_OPENING_LINE2", "S_PRESSURE_LINE1", "S_PRESSURE_LINE2")
STATE = (
    *(name for name in globals() if name.startswith("S_") and name not in _DELAY_LINES),
    *(f"{name}_{i}" if i else name for name in _DELAY_LINES for i in range(DELAY_LINE_SAMPLES)),
)
PARAMETERS = tuple(name for name in globals() if name.startswith("C_"))
COMPONENT_SWITCHES = ("C_FEEDFORWARD", "C_DISTURBANCE_OBSERVERS", "C_HOLD", "C_SWITCHING", "C_INVERSE_MAP")

# along the stroke: factors on dry friction and what else brakes (N s/m) toward +x and back, what pushes at rest (N)
STROKE_TABLES = {"dry_up": "1", "dry_back": "1", "damping_up": "N s/m", "damping_back": "N s/m", "push": "N"}

# a law's own states and numbers stand behind the common ones (:mod:`pneucli.controller.laws`)
FIRST_LAW_STATE, MAX_LAW_STATES = len(STATE), 8
FIRST_LAW_PARAMETER = C_TABLE + 4 * TABLE_NODES + len(STROKE_TABLES) * STROKE_NODES

# in the closed loop the state is followed by a row a sample: what the sensors add, what the controller read and made
(L_NOISE_X, L_NOISE_P1, L_NOISE_P2, L_READ_X, L_READ_P1, L_READ_P2, L_U1, L_U2) = range(8)
(L_LOAD, L_FLOW1, L_P1_REF, L_P2_REF, L_X_SHAPED, L_V, L_FORCE) = range(8, 15)
(L_SUPPLY, L_MODE) = range(15, 17)  # measured supply pressure in Pa, 0 where it is not; what is asked of the operation
L_LEVEL = 17  # Pa: level that is set, 0: as designed
L_STATES, L_ROW = len(STATE) + MAX_LAW_STATES, 18
# L_MODE counts them; "follow": the last commands were those that stand where this sample's will
OPERATING_MODES = ("run", "hold", "off", "reset", "follow")

UNITS = {
    **dict.fromkeys(("C_PERIOD", "C_MOTION_WINDOW", "C_SHAPING_TIME", "C_FRICTION_LEAD"), "s"),
    "C_U_MAX": "V",
    "C_MASS": "kg",
    **dict.fromkeys(("C_AREA_1", "C_AREA_2", "C_AREA_FILL", "C_AREA_VENT", "C_AREA_FILL_2", "C_AREA_VENT_2"), "m^2"),
    **dict.fromkeys(("C_STROKE", "C_HOLDING_BAND"), "m"),
    **dict.fromkeys(("C_DEAD_VOLUME_1", "C_DEAD_VOLUME_2"), "m^3"),
    **dict.fromkeys(("C_AMBIENT", "C_SUPPLY", "C_P_LOW", "C_P_HIGH", "C_P_MEAN", "C_PRESSURE_BAND"), "Pa"),
    "C_GAMMA_R_T": "J/kg",
    "C_K_GAS": "s/m",
    **dict.fromkeys(("C_COULOMB", "C_STATIC", "C_LOAD_STEP_MAX", "C_RELEASE_FORCE_MAX", "C_BREAKAWAY_MAX"), "N"),
    **dict.fromkeys(("C_STRIBECK", "C_V_FLOOR", "C_V_MAX"), "m/s"),
    **dict.fromkeys(("C_VISCOUS", "C_VISCOUS_BACK"), "N s/m"),
    **dict.fromkeys(("C_DRY_P1", "C_DRY_P2"), "1/Pa"),
    "C_A_MAX": "m/s^2",
    **dict.fromkeys(("C_KP", "C_P_KI"), "1/s^2"),
    **dict.fromkeys(("C_KD", "C_P_KP", "C_OBS_V", "C_OBS_FLOW", "C_SECTOR_1", "C_SECTOR_2"), "1/s"),
    "C_KI": "1/s^3",
    "C_RAMP_RATE_PER_ERROR": "N/(s m)",
    "C_AIR_STIFFNESS": "N/m",
    "C_LEVEL_RATE": "Pa/s",
    **dict.fromkeys(("C_RAMP_RATE_MIN", "C_RAMP_RATE_MAX"), "N/s"),
    **dict.fromkeys(("C_PLAY", "C_PLAY_DEADBAND"), "V"),
    **dict.fromkeys(("C_OFFSET_1", "C_OFFSET_2"), "Pa"),
    **dict.fromkeys(("C_LEAK_1", "C_LEAK_2", "C_LEAK_12", "C_LEAK_VALVE"), "m^2"),
    "C_PRESLIDING_DISTANCE": "m",
    "C_BRAKE_DAMPING": "N s/m",
    **dict.fromkeys(("C_RAMP_GROWTH_RATE", "C_UNLOADING_RATE", "C_CLOSING_RATE"), "1/s"),
    "C_OBS_LOAD": "N/m",
    "C_FLOW_STEP_MAX": "Pa/s",
}  # by parameter; those that are left out have none
