"""The conditions of an exam by name, what each excludes, and the lines from which ``wide`` draws."""

from __future__ import annotations

from pneucli.exam.condition import Condition, Kind, constant_change
from pneucli.exam.hidden_effect import VALVE
from pneucli.exam.hidden_effects import CATALOGUE, UNCATALOGUED
from pneucli.exam.hidden_sides import SIDES

RIGS_WITH_PISTON: tuple[Kind, ...] = ("friction", "axis")
RIGS_WITH_VALVE: tuple[Kind, ...] = ("valve", "axis")
USUAL, WIDE = "usual", "wide"

WIDE_SHARE = 0.6  # of the lines, from which "wide" draws one condition each
WIDE_CHOICES = (
    ("usual", "bore-6mm", "bore-12mm", "bore-50mm", "bore-100mm", "bore-200mm"),
    ("usual", "supply-3bar", "supply-5bar", "supply-12bar", "supply-50bar"),
    ("usual", "rate-200Hz", "rate-500Hz", "rate-2000Hz", "rate-5000Hz", "rate-10000Hz"),
    ("usual", "5/3", "5/3-5V", "5/3-null", "two-valves"),
    ("usual", "usual", "usual", "switching"),
    ("usual", "usual", "regulated-valve", "pump"),
    ("usual", "wall-heat"),
    ("usual", "free-b"),
    ("usual", "usual", "hose"),
    ("usual", "usual", "no-bench-test"),
    ("usual", "usual", "both-sides"),
    ("usual", "usual", "held-commands"),
    ("usual", "usual", "imposed", "constant-speed"),
    ("usual", "usual", "return-spring", "hanging-load", "differential"),
    ("usual", "ends"),
    ("usual", "messy"),
    ("usual", "usual", "bits-8", "bits-10", "bits-12", "bits-16"),
    ("usual", "usual", "no-acceleration", "encoder"),
    ("usual", "usual", "no-p2"),
    ("usual", "usual", "usual", "drift"),
    ("usual", "usual", "usual", "outliers"),
)

# a valve map contains the overlap, and a switching valve has no map
EXCLUDED_WITH_VALVE_MAP = frozenset({"valve-deadband"})
EXCLUDED_WITH_SWITCHING = EXCLUDED_WITH_VALVE_MAP | {"valve-lag", "valve-hysteresis", "spool sticks and jumps"}
# the rest position of a spring compensates any other constant force
EXCLUDED_WITH_LOAD = frozenset({"constant-force", "spring-force"})
# not visible in slow strokes at constant pressure
EXCLUDED_WITH_IMPOSED_MOTION = frozenset(
    {
        *("presliding", "dwell-breakaway", "friction-hysteresis", "extra-mass", "end-cushion", "acceleration-bias"),
        *("pressure-lag", "time-skew", "quadratic drag", "curved characteristic of the sensor of x"),
        *("resonance of a flexibly coupled load", "backlash between piston and load"),
    }
)
# disturbances that resemble no effect of the catalogue
DRIFTING_AND_PERIODIC_EFFECTS = frozenset(
    {
        *("dry friction falls over the first seconds", "viscous friction falls while warming up"),
        *("force periodic over position", "supply ripple that its sensor misses"),
        "valve gain drifts over each recording",
    }
)
EXCLUDED_WITH_TANK = frozenset({"supply-droop", "line-delay", "critical-ratio"})
# without a side
EXCLUDED_WITH_SIDES = frozenset(effect.name for effect in CATALOGUE) - frozenset(SIDES)
# of the chamber, the valve and its supply: not visible where the command sets no area
EXCLUDED_WITHOUT_AREA = (
    frozenset(effect.name for effect in CATALOGUE if VALVE[0] in effect.kinds and "friction" not in effect.kinds)
    | {"piston-leak", "dead-volume", "valve-deadband"}
    | {effect.name for effect in UNCATALOGUED if effect.part == "flow"}
)

CONDITIONS = (
    Condition(USUAL, "nothing but the usual", constant_change()),
    Condition("bore-#mm", "a piston of this diameter", lambda mm: {"bore": mm * 1e-3}, 6, 200),
    Condition("supply-#bar", "a supply of this pressure, absolute", lambda bar: {"supply": bar * 1e5}, 3, 50),
    Condition("rate-#Hz", "logged at this rate; the loop keeps its 1 kHz", lambda hz: {"rate": hz}, 100, 10_000),
    Condition(
        "ends",
        "at rest against the ends for up to 80 % of the time",
        constant_change(ends=True),
        kinds=RIGS_WITH_PISTON,
    ),
    Condition(
        "5/3",
        "one 5/3 valve for both chambers, at rest at 0 V",
        constant_change(valve="5/3"),
        excluded=EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition(
        "5/3-5V",
        "the same at rest at 5 V",
        constant_change(valve="5/3", null=5.0, null_stated="5 V", command=5.0),
        excluded=EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition(
        "5/3-null",
        "the same at rest near 5 V, to be identified",
        constant_change(valve="5/3", null=5.0, null_stated="identify", command=5.0),
        excluded=EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition(
        "two-valves",
        "a valve of its own for each chamber",
        constant_change(valve="two"),
        excluded=EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition(
        "switching",
        "valves that are open or shut",
        constant_change(switching=True, command=24.0),
        kinds=RIGS_WITH_VALVE,
        excluded=EXCLUDED_WITH_SWITCHING,
    ),
    Condition(
        "return-spring",
        "a preloaded spring to x = 0",
        constant_change(load="spring"),
        kinds=RIGS_WITH_PISTON,
        excluded=EXCLUDED_WITH_LOAD | EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition(
        "hanging-load",
        "a weight that the piston carries",
        constant_change(load="weight"),
        kinds=RIGS_WITH_PISTON,
        excluded=EXCLUDED_WITH_LOAD | EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition("differential", "a thick rod", constant_change(differential=True), kinds=RIGS_WITH_PISTON),
    Condition(
        "tank",
        "a vessel filled through a hose from a finite tank",
        constant_change(tank=True),
        kinds=("valve",),
        excluded=EXCLUDED_WITH_TANK,
    ),
    Condition(
        "hose",
        "hoses of 0.5 to 3 m with volume, inertia and friction",
        constant_change(hose=True),
        kinds=RIGS_WITH_VALVE,
        excluded=frozenset({"line-delay"}),
    ),
    Condition(
        "imposed",
        "a machine drives the piston slowly at held pressures, and its force is measured",
        constant_change(imposed=True, rate=100.0),
        kinds=("friction",),
        excluded=EXCLUDED_WITH_IMPOSED_MOTION,
    ),
    Condition(
        "constant-speed",
        "a machine drives the piston at one speed for each recording, and its force is measured",
        constant_change(imposed=True, constant_speed=True, rate=500.0),
        kinds=("friction",),
        excluded=EXCLUDED_WITH_IMPOSED_MOTION,
    ),
    Condition(
        "encoder",
        "no acceleration, and an encoder of 2 to 20 um",
        constant_change(absent=frozenset({"a"}), encoder=True),
        kinds=RIGS_WITH_PISTON,
        excluded=frozenset({"acceleration-bias"}),
    ),
    Condition(
        "wall-heat",
        "walls that warm and cool the gas by convection",
        constant_change(wall_heat=True),
        kinds=RIGS_WITH_VALVE,
        excluded=frozenset({"heat-transfer"}),
    ),
    Condition(
        "free-b",
        "a valve with a critical ratio of 0.15 to 0.5",
        constant_change(free_ratio=True),
        kinds=RIGS_WITH_VALVE,
        excluded=frozenset({"critical-ratio"}),
    ),
    Condition(
        "no-bench-test",
        "a valve that no bench has tested",
        constant_change(bench_test=False),
        kinds=("axis",),
        excluded=EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition(
        "both-sides",
        "effects of either chamber and either sensor",
        constant_change(sides=True),
        kinds=("axis",),
        excluded=EXCLUDED_WITH_SIDES,
    ),
    Condition(
        "held-commands",
        "a controller of 5 to 20 ms holds its command, which is logged on a clock of its own",
        constant_change(held=True),
        kinds=RIGS_WITH_VALVE,
    ),
    Condition(
        "regulated-valve",
        "a valve with a pressure loop of its own",
        constant_change(valve=None, source="regulated", null=5.0, command=5.0),
        kinds=("axis",),
        excluded=EXCLUDED_WITHOUT_AREA,
    ),
    Condition(
        "pump",
        "a pump fills the chamber, its command sets the speed",
        constant_change(valve=None, source="pump"),
        kinds=("axis",),
        excluded=EXCLUDED_WITHOUT_AREA,
    ),
    Condition("messy", "several small unknown effects in every case", constant_change(messy=True)),
    Condition(
        "rough",
        "several unknown effects of nearly full size in every case",
        constant_change(messy=True, mess=(0.3, 1.0)),
    ),
    Condition(
        "uneven",
        "friction that warms up, a force over the stroke, a supply that ripples, a gain that drifts, all small",
        constant_change(messy=True, mess_of=DRIFTING_AND_PERIODIC_EFFECTS),
    ),
    Condition("bits-#", "converters of so many bits", lambda bits: {"bits": int(bits)}, 8, 16),
    Condition(
        "no-acceleration",
        "not measured",
        constant_change(absent=frozenset({"a"})),
        kinds=RIGS_WITH_PISTON,
        excluded=frozenset({"acceleration-bias"}),
    ),
    Condition("no-p2", "not measured", constant_change(absent=frozenset({"p2"})), kinds=("axis",)),
    Condition("drift", "zeros of sensors wander", constant_change(drift=4.0)),
    Condition("outliers", "one sample in 2000 is wrong", constant_change(outliers=5e-4)),
    Condition(WIDE, "any of these, drawn anew for each case", constant_change()),
)
