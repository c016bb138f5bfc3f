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
