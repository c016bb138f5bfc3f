"""Indices of the two arrays of the controller: its state and its parameters."""

TABLE_NODES = 201  # of each inverse table
STROKE_NODES = 101  # of each table along the stroke
DELAY_LINE_SAMPLES = 64  # of each delay line: openings on their way through the hose, expected readings of the sensors
OPEN_CHAMBER_VOLUME = 1e3  # m^3: an open chamber 2 is modelled as a closed one of this size, at constant pressure

(
    S_STARTED,  # 1 after the first sample
    S_U1,  # V, the commands of this sample
    S_U2,
    S_X,  # m, m/s: observed motion
    S_V,
    S_V_SEEN,  # m/s: rate of the observed position, whatever friction the model has
    S_UNSEEN,  # samples since the last reading of the position
    S_LOAD,  # N: filtered estimate of the load, positive toward +x
    S_P1,  # Pa: observed pressures
    S_P2,
    S_RATE1,  # Pa/s: pressure gradients that the last command should make
    S_RATE2,
    S_FLOW1,  # Pa/s: filtered estimates of unmodelled pressure gradients
    S_FLOW2,
    S_X_REF,  # m: last reference; its last rate and filtered rate in m/s, and its filtered acceleration in m/s^2
    S_RAW_RATE,
    S_V_REF,
    S_A_REF,
    S_X_SHAPED,  # m, m/s, m/s^2: shaped reference, within the limits of the axis
    S_V_SHAPED,
    S_A_SHAPED,
    S_REF_REST_TIME,  # s: time since the reference came to rest
    S_HOLD,  # 1: the piston is held where it sticks
    S_ANCHOR,  # m: low-passed position; and samples since the piston began to move away from it
    S_MOVING_COUNT,
    S_REST_TIME,  # s: duration of the last rest of the piston
    S_BREAKAWAY_FORCE,  # N: last break-away force beyond the load, and the force that is applied to break away
    S_RELEASE_FORCE,
    S_ADDED_FRICTION,  # 1: dry friction beyond that of the model over it, learnt at reversals of the reference
    S_WAY,  # sign of the reference's present way; s: time of sliding along it; N: mean load estimate over that time
    S_WAY_TIME,
    S_WAY_LOAD,
    S_OTHER_TIME,  # the same of the way before it
    S_OTHER_LOAD,
    S_LAST_SIGN,  # sign of the last error; factor on the ramp rate after overshoots (above 1: full rate)
    S_RAMP_GAIN,
    S_BRAKING_TIME,  # s: remaining braking time of a freed piston
    S_ELASTIC,  # 1: the piston moved under a force that friction must hold; -1: refuted until the reference moves
    S_STILL_X,  # m, N: where the piston last moved by a motion step, and the air's force there
    S_STILL_FORCE,
    S_EXCURSION,  # m: distance since the last reversal or rest; N: peak of the force along it, the air's at its begin
    S_PEAK_FORCE,
    S_FIRST_FORCE,
    S_FROM_HOLD,  # 1: it began while the piston was held
    S_LOOP_GAIN,  # 1: factor on the position loop, reduced after oscillation on elastic seals
    S_FORCE_RAMP,  # N: rise of the force on an elastic piston since it sticks
    S_DEADBAND_GAIN,  # 1: factor on the holding band, increased after overshoots
    S_BREAKAWAY_POSITION,  # m: position of the last break-away; and the length of the last jump
    S_LAST_JUMP,
    S_FORCE,  # N: requested pressure force; and its integral part
    S_INTEGRAL,
    S_P1_REF,  # Pa
    S_P2_REF,
    S_INTEGRAL1,  # Pa/s
    S_INTEGRAL2,
    S_SUPPLY,  # Pa: measured supply pressure, 0: not measured
    S_DISABLED,  # 1: the controller is disabled
    S_HOLD_REQUEST,  # 1: a hold is requested, 2: the axis holds; and its reference in m or Pa
    S_HOLD_REFERENCE,
    S_RESET_PHASE,  # 2: reset from the next readings, 1: the next command continues from the present one
    S_BUMPLESS_OFFSET1,  # V: decaying offsets of the commands after a reset
    S_BUMPLESS_OFFSET2,
    S_PLAY1,  # V: positions of play and spool of the valves
    S_PLAY2,
    S_SPOOL1,
    S_SPOOL2,
    S_SENSOR_P1,  # Pa: expected readings of lagging pressure sensors
    S_SENSOR_P2,
    S_PREDICTED_X,  # m, m/s, Pa: motion and pressures at the time when the present command arrives
    S_PREDICTED_V,
    S_PREDICTED_P1,
    S_PREDICTED_P2,
    S_LINE_INDEX,  # index of the latest entry of all delay lines
    S_LEVEL,  # Pa: present reference of the mean pressure; 0: not yet initialised
    S_LEVEL_SET,  # Pa: mean pressure set by the user, 0: as designed
    # of the commissioning (:mod:`pneucli.controller.commissioning`), which a reset keeps
    S_COMMISSIONING,  # state, see there; and the time in it in s
    S_COMMISSIONING_TIME,
    S_TRAVEL_LIMIT,  # m, Pa: limits from where the test began
    S_PRESSURE_LIMIT,
    S_START_X,
    S_START_STEP,  # m: the last step of the readings of x with the valves shut
    S_START_P1,
    S_START_P2,
    S_LOST_COUNT,  # samples without a reading
    S_RELAY_PRESSURE,  # Pa: filtered pressure that the relay switches by
    S_RELAY_SIGN,  # 1: the relay fills, -1: it vents; 1: the pressure is in the far half of the band; s since a switch
    S_RELAY_INSIDE,
    S_RELAY_TIME,
    S_RELAY_WIDTH,  # 1: factor on the rate of the relay; and half cycles that are complete
    S_RELAY_COUNT,
    S_TIME_OUTSIDE,  # s: sums outside that half, and within it upwards and downwards
    S_TIME_UP,
    S_TIME_DOWN,
    S_RELAY_PEAK,  # Pa: present overshoot of the band, and its sums above and below
    S_PEAKS_UP,
    S_PEAKS_DOWN,
    S_DELAY_TESTED,  # s, s, 1: of the valves so far, as what is found once all are tested
    S_OVERSHOOT_TESTED,
    S_GAIN_TESTED,
    S_NULL_SHIFT1,  # V: what this test adds to the null commands; and all that tests added to those of the design
    S_NULL_SHIFT2,
    S_NULL_FOUND1,
    S_NULL_FOUND2,
    S_DELAY_FOUND,  # s: delay from command to pressure, its share that lets the pressure overshoot; 0: not measured
    S_OVERSHOOT_FOUND,
    S_GAIN_FOUND,  # 1: rate of the pressure over that of the model
    S_MEMBER,  # member of the family of gains from 1 on, 0: as designed
    S_SWING_EDGE,  # m: last turn of a swing at rest, and the farthest position since
    S_SWING_PEAK,
    S_SWING_TIME,  # s since that turn
    S_SWING_COUNT,  # half swings of a limit cycle, the length of the last in m, and its period in s
    S_SWING_AMPLITUDE,
    S_SWING_PERIOD,
) = range(113)

# delay lines (ring buffers) follow: openings in V and expected pressure readings in Pa
S_OPENING_LINE1, S_OPENING_LINE2, S_PRESSURE_LINE1, S_PRESSURE_LINE2 = (113 + i * DELAY_LINE_SAMPLES for i in range(4))

(
    C_PERIOD,  # s
    C_U_MAX,  # V
    C_TWO_VALVES,  # 1: a second valve drives chamber 2
    C_MIRRORED,  # 1: one 5/3 spool drives both chambers
    C_FEEDFORWARD,  # 1: feed-forward of mass and friction along the reference, and of the piston's motion
    C_DISTURBANCE_OBSERVERS,  # 1: subtract both disturbance estimates, 0: integrate the errors instead
    C_HOLD,  # 1: hold the piston where it sticks near a resting reference, with the valve shut
    C_SWITCHING,  # 1: free a piston that sticks off its reference by the integral of the switching term
    C_INVERSE_MAP,  # 1: commands by the inverse valve map, 0: proportional to the gradient
    C_PRESSURE_MODE,  # 1: pressure control, the reference is the pressure of chamber 1 in Pa
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
    C_DECELERATION_RATIO,  # 1: dry friction while decelerating over Coulomb friction; -1: one branch
    C_DRY_P1,  # 1/Pa: relative increase of dry friction with the pressures above ambient
    C_DRY_P2,
    C_V_FLOOR,  # m/s: resolution of the speed; below it the direction of motion is unknown
    C_V_MAX,  # limits of the shaped reference in m/s and m/s^2, and its time constant in s
    C_A_MAX,
    C_SHAPING_TIME,
    C_FRICTION_LEAD,  # s: lead of the friction feed-forward, the lag of the pressure loop
    C_KP,  # 1/s^2, 1/s, 1/s^3
    C_KD,
    C_KI,
    C_SECTOR_1,  # 1/s: slopes of the sector of the release ramp
    C_SECTOR_2,
    C_RAMP_RATE_PER_ERROR,  # N/(s m), N/s, N/s: rate of the release ramp per error, its minimum and maximum
    C_RAMP_RATE_MIN,
    C_RAMP_RATE_MAX,
    C_BREAKAWAY_MAX,  # N: largest break-away force expected after a short rest
    C_PRESLIDING_DISTANCE,  # m: largest elastic excursion of the seals; beyond it the piston slides
    C_RAMP_GROWTH_RATE,  # 1/s: growth rate of the force on an elastic piston that sticks
    C_RELEASE_FORCE_MAX,  # N: largest release force
    C_UNLOADING_RATE,  # 1/s: rate at which the ramp of an elastic piston is unloaded
    C_CLOSING_RATE,  # 1/s: closing speed of an elastic piston per error, N/(s m): rate of its force per error
    C_ELASTIC_RATE,
    C_BRAKE_DAMPING,  # N s/m: damping near the reference
    C_DEADBAND_GAIN_MAX,  # 1: largest factor on the holding band
    C_MOTION_WINDOW,  # s: time in which motion is detected and a piston is braked
    C_HOLDING_BAND,  # m: error within which the piston is held
    C_MOTION_STEP,  # m: half of the least motion that the position shows beyond its noise
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
    C_PRESSURE_BAND,  # Pa: pressure error within which the valves stay shut while the piston is held
    C_P_LOW,  # Pa: range of the pressure references
    C_P_HIGH,
    C_P_MEAN,  # Pa: mean of both pressures of an axis with two valves
    C_AIR_STIFFNESS,  # N/m: gas stiffness that sets the mean pressure, 0: C_P_MEAN; and the rate of the mean in Pa/s
    C_LEVEL_RATE,
    C_AREA_FILL,  # m^2: largest effective areas of the paths of chamber 1, and of chamber 2
    C_AREA_VENT,
    C_AREA_FILL_2,
    C_AREA_VENT_2,
    C_SPOOL_SHARE,  # 1: share of its travel that a spool makes in a sample, its mean, and the share requested
    C_SPOOL_MEAN_SHARE,
    C_SPOOL_LEAD,
    C_PLAY,  # V: half of the play between command and spool, and the change that is not passed on
    C_PLAY_DEADBAND,
    C_FLOW_DELAY,  # samples: delay between spool and chamber
    C_SENSOR_SHARE,  # 1: share of a step that a pressure sensor follows in a sample; and its delay in samples
    C_SENSOR_DELAY,
    C_SCALE_1,  # 1, Pa: readings of p1 and p2 are scale p + zero
    C_SCALE_2,
    C_OFFSET_1,
    C_OFFSET_2,
    C_LEAK_1,  # m^2: leaks of the chambers to ambient, between them, of the valve
    C_LEAK_2,
    C_LEAK_12,
    C_LEAK_VALVE,
    C_RELAY_BAND,  # Pa: half band of the relay test, and the rate of pressure in Pa/s that it asks for
    C_RELAY_RATE,
    C_TRAVEL_LIMIT,  # m, Pa: limits of the relay test, where the caller states none
    C_PRESSURE_LIMIT,
    C_FAMILY,  # place of the family of gains behind all else, its members, and the parameters that they change
    C_FAMILY_MEMBERS,
    C_FAMILY_WIDTH,
    C_STROKE_NODES,  # nodes of each table along the stroke; these follow the inverse tables
    C_TABLE_NODES,  # nodes of each inverse table: commands in V at (i / (nodes - 1))^2 of the largest area,
    # filling and venting chamber 1, then chamber 2
    C_TABLE,
) = range(101)

_DELAY_LINES = ("S_OPENING_LINE1", "S_OPENING_LINE2", "S_PRESSURE_LINE1", "S_PRESSURE_LINE2")
STATE = (
    *(name for name in globals() if name.startswith("S_") and name not in _DELAY_LINES),
    *(f"{name}_{i}" if i else name for name in _DELAY_LINES for i in range(DELAY_LINE_SAMPLES)),
)
PARAMETERS = tuple(name for name in globals() if name.startswith("C_"))
COMPONENT_SWITCHES = ("C_FEEDFORWARD", "C_DISTURBANCE_OBSERVERS", "C_HOLD", "C_SWITCHING", "C_INVERSE_MAP")

# tables along the stroke: factors on dry friction, added damping toward +x and back, static force toward +x
STROKE_TABLES = {"dry_up": "1", "dry_back": "1", "damping_up": "N s/m", "damping_back": "N s/m", "push": "N"}

# the own states and parameters of a law follow the common ones (:mod:`pneucli.controller.laws`)
FIRST_LAW_STATE, MAX_LAW_STATES = len(STATE), 8
FIRST_LAW_PARAMETER = C_TABLE + 4 * TABLE_NODES + len(STROKE_TABLES) * STROKE_NODES

# in the closed loop one log row a sample follows the state: sensor noise, readings, commands, estimates
(L_NOISE_X, L_NOISE_P1, L_NOISE_P2, L_READ_X, L_READ_P1, L_READ_P2, L_U1, L_U2) = range(8)
(L_LOAD, L_FLOW1, L_P1_REF, L_P2_REF, L_X_SHAPED, L_V, L_FORCE) = range(8, 15)
(L_SUPPLY, L_MODE) = range(15, 17)  # measured supply pressure in Pa, 0: not measured; operating mode
L_LEVEL = 17  # Pa: mean pressure set by the user, 0: as designed
L_STATES, L_ROW = len(STATE) + MAX_LAW_STATES, 18
# by L_MODE; "follow": the last commands were those in this row of the log
OPERATING_MODES = ("run", "hold", "off", "reset", "follow", "commission")

UNITS = {
    **dict.fromkeys(("C_PERIOD", "C_MOTION_WINDOW", "C_SHAPING_TIME", "C_FRICTION_LEAD"), "s"),
    "C_U_MAX": "V",
    "C_MASS": "kg",
    **dict.fromkeys(("C_AREA_1", "C_AREA_2", "C_AREA_FILL", "C_AREA_VENT", "C_AREA_FILL_2", "C_AREA_VENT_2"), "m^2"),
    **dict.fromkeys(("C_STROKE", "C_HOLDING_BAND", "C_MOTION_STEP"), "m"),
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
    **dict.fromkeys(("C_RAMP_RATE_PER_ERROR", "C_ELASTIC_RATE"), "N/(s m)"),
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
    **dict.fromkeys(("C_FLOW_STEP_MAX", "C_RELAY_RATE"), "Pa/s"),
    **dict.fromkeys(("C_RELAY_BAND", "C_PRESSURE_LIMIT"), "Pa"),
    "C_TRAVEL_LIMIT": "m",
}  # by parameter; parameters without an entry have no unit
