"""Where each number stands in the arrays that the kernel takes: parameters, inputs, flags, outputs."""

# base parameters, in the order of the kernel's vector; the names are those of the JSON answers
BASE_NAMES = (
    "friction.coulomb",
    "friction.viscous",
    "rig.moving_mass",
    "rig.piston_area_1",
    "rig.piston_area_2",
    "rig.stroke",
    "rig.dead_volume_1",
    "rig.dead_volume_2",
    "rig.ambient_pressure",
    "rig.supply_pressure",
    "rig.gas_temperature",
    "rig.heat_capacity_ratio",
    "rig.gas_constant",
    "valve.critical_ratio",
    "rig.wall_temperature",
    "valve.null",
    "rig.lower_end",
    "rig.upper_end",
    "rig.polytropic_exponent",
)
COULOMB, VISCOUS, MASS, AREA_1, AREA_2, STROKE, DEAD_1, DEAD_2 = range(8)
AMBIENT, SUPPLY, TEMP, GAMMA, GAS, CRITICAL, WALL, NULL, LOWER_END, UPPER_END, EXPONENT = range(8, 19)

# columns of the inputs: commands (held), measured signals (interpolated, smoothed readings)
IN_U, IN_U2, IN_SUPPLY, IN_P1, IN_P2, IN_FORCE, IN_X, IN_V = range(8)
INPUTS = ("u", "u2", "p_supply", "p1", "p2", "force", "x", "v")

# switches of a recording
MECHANICS, PNEUMATICS, CHAMBER_2, VALVE_SHUT, LOOP, U_MAX, INITIAL_U, INITIAL_U2, STATED_SUPPLY = range(9)
CLOSED, OPEN, VALVE_2, MIRRORED = 0, 1, 2, 3  # of chamber 2; mirrored: by the other way of one spool (5/3)
FLAGS = 9

# columns of the output; R1 and R2 are what the sensors of p1 and p2 read, A what the accelerometer does, FLOW what goes
# through the valve of chamber 1
X, V, A, P1, P2, R1, R2, GAS_T, U, FLOW = range(10)
OUTPUTS = 10

# columns of the output of a simulation with dual numbers: what may depend on a parameter, and one for all else
D_P1, D_P2, D_R1, D_R2, D_GAS_T, D_FLOW, D_REST = range(7)
D_OUTPUTS = 7

# state of the plant with a step function (:mod:`pneucli.simulate.kernel.plant`)
AT_X, AT_V, AT_Z, AT_REST, AT_DV, AT_P1, AT_P2, AT_DP1, AT_DP2, AT_M1, AT_M2, AT_T1, AT_T2, AT_Q = range(14)
AT_R1, AT_R2, AT_BEFORE_1, AT_BEFORE_2, AT_HEAD, AT_TAIL, AT_TAIL_2, AT_FLOW = range(14, 22)
AT_END_1, AT_END_2, AT_THROUGH_1, AT_THROUGH_2 = range(22, 26)
PLANT_STATES = 26

# its start: position, velocity, pressures, openings; its inputs; its outputs
START_X, START_V, START_P1, START_P2, START_U, START_U2 = range(6)
PLANT_START = ("x", "v", "p1", "p2", "u", "u2")
PLANT_U, PLANT_U2, PLANT_SUPPLY, PLANT_FORCE = range(4)
PLANT_INPUTS = ("u", "u2", "p_supply", "force")
PLANT_OUTPUTS = ("x", "v", "a", "p1", "p2", "temperature", "flow", "chamber_1.p", "chamber_2.p")
