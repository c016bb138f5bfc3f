"""The conditions under which the cases of an exam are recorded; each has a name, such as ``rate-200Hz``.

Names joined by ``+`` hold together. The usual conditions are a bore near 32 mm, 7 bar and 1 kHz.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from pneucli.errors import InputError, did_you_mean

if TYPE_CHECKING:
    import numpy as np

Kind = Literal["valve", "friction", "axis"]
KINDS: tuple[Kind, ...] = ("valve", "friction", "axis")
RIGS_WITH_PISTON: tuple[Kind, ...] = ("friction", "axis")
RIGS_WITH_VALVE: tuple[Kind, ...] = ("valve", "axis")
USUAL, WIDE = "usual", "wide"

# "wide" draws one condition from each line, most often the first
WIDE_CHOICES = (
    ("usual", "bore-6mm", "bore-12mm", "bore-50mm", "bore-100mm", "bore-200mm"),
    ("usual", "supply-3bar", "supply-5bar", "supply-12bar", "supply-50bar"),
    ("usual", "rate-200Hz", "rate-500Hz", "rate-2000Hz", "rate-5000Hz", "rate-10000Hz"),
    ("usual", "5/3", "5/3-5V", "5/3-null", "two-valves"),
    ("usual", "usual", "usual", "switching"),
    ("usual", "usual", "return-spring", "hanging-load", "differential"),
    ("usual", "ends"),
    ("usual", "messy"),
    ("usual", "usual", "bits-8", "bits-10", "bits-12", "bits-16"),
    ("usual", "usual", "no-acceleration"),
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


@dataclass(frozen=True)
class Conditions:
    """All conditions of a case, SI; the defaults are the usual ones, None lets the case draw the value."""

    names: tuple[str, ...] = ()
    bore: float | None = None  # m
    supply: float | None = None  # Pa, absolute
    rate: float = 1000.0  # Hz, of the logger
    ends: bool = False  # the piston rests at its ends most of the time
    valve: str | None = None  # [rig.valve] arrangement; None: the valve drives one chamber, the default
    null: float = 0.0  # V
    null_stated: str | None = None  # the null in the pipeline file
    command: float = 10.0  # V from the null, at which the valve is fully open
    switching: bool = False
    load: str | None = None  # "spring" or "weight"
    differential: bool = False
    tank: bool = False
    imposed: bool = False  # a machine imposes the motion and its force is measured
    messy: bool = False  # several disturbances outside the catalogue act as well
    mess: tuple[float, float] = (0.05, 0.25)  # range of their sizes, relative to the usual
    mess_of: frozenset[str] = frozenset()  # the disturbances to draw from; all if empty
    bits: int = 0  # of the converters; 0: finer than the noise
    drift: float = 0.0  # of the sensors' zeros over a recording, relative to their noise
    outliers: float = 0.0  # share of the samples
    absent: frozenset[str] = frozenset()  # signals that are not recorded
    kinds: tuple[Kind, ...] = KINDS  # of rigs that can have these conditions
    excluded: frozenset[str] = frozenset()  # effects that are not identifiable under these conditions

    @property
    def allows_unexplained(self) -> bool:
        """Whether every case has a disturbance that no effect of the catalogue explains."""
        return self.messy or self.drift > 0.0

    @property
    def allows_linear(self) -> bool:
        """Whether the valve may be described by one gain."""
        return self.allows("valve-deadband")

    def allows(self, effect: str) -> bool:
        """Whether the effect may be hidden under these conditions."""
        return effect not in self.excluded

    def allows_small(self, effect: str) -> bool:
        """Whether this disturbance may act as well."""
        return self.allows(effect) and (not self.mess_of or effect in self.mess_of)


@dataclass(frozen=True)
class Condition:
    """One kind of condition: ``#`` in its ``pattern`` is a number from ``minimum`` to ``maximum``, from which
    ``change`` makes fields of :class:`Conditions`.
    """

    pattern: str
    description: str
    change: Callable[[float], dict[str, Any]]
    minimum: float = 0.0
    maximum: float = 0.0
    kinds: tuple[Kind, ...] = KINDS
    excluded: frozenset[str] = frozenset()

    def match(self, name: str) -> dict[str, Any] | None:
        """Return the changes for ``name``; None where the pattern differs. Raises InputError beyond the limits."""
        found = re.fullmatch(re.escape(self.pattern).replace(r"\#", r"(\d+(?:\.\d+)?)"), name)
        if found is None:
            return None
        value = float(found[1]) if found.groups() else 0.0
        if not self.minimum <= value <= self.maximum:
            raise InputError(
                "--condition", name, f"{self.pattern} with # from {self.minimum:g} to {self.maximum:g}", code="E031"
            )
        return self.change(value)


def _constant_change(**change: Any) -> Callable[[float], dict[str, Any]]:
    return lambda _: change


CONDITIONS = (
    Condition(USUAL, "nothing but the usual", _constant_change()),
    Condition("bore-#mm", "a piston of this diameter", lambda mm: {"bore": mm * 1e-3}, 6, 200),
    Condition("supply-#bar", "a supply of this pressure, absolute", lambda bar: {"supply": bar * 1e5}, 3, 50),
    Condition("rate-#Hz", "logged at this rate; the loop keeps its 1 kHz", lambda hz: {"rate": hz}, 100, 10_000),
    Condition(
        "ends",
        "at rest against the ends for up to 80 % of the time",
        _constant_change(ends=True),
        kinds=RIGS_WITH_PISTON,
    ),
    Condition(
        "5/3",
        "one 5/3 valve for both chambers, at rest at 0 V",
        _constant_change(valve="5/3"),
        excluded=EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition(
        "5/3-5V",
        "the same at rest at 5 V",
        _constant_change(valve="5/3", null=5.0, null_stated="5 V", command=5.0),
        excluded=EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition(
        "5/3-null",
        "the same at rest near 5 V, to be identified",
        _constant_change(valve="5/3", null=5.0, null_stated="identify", command=5.0),
        excluded=EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition(
        "two-valves",
        "a valve of its own for each chamber",
        _constant_change(valve="two"),
        excluded=EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition(
        "switching",
        "valves that are open or shut",
        _constant_change(switching=True, command=24.0),
        kinds=RIGS_WITH_VALVE,
        excluded=EXCLUDED_WITH_SWITCHING,
    ),
    Condition(
        "return-spring",
        "a preloaded spring to x = 0",
        _constant_change(load="spring"),
        kinds=RIGS_WITH_PISTON,
        excluded=EXCLUDED_WITH_LOAD | EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition(
        "hanging-load",
        "a weight that the piston carries",
        _constant_change(load="weight"),
        kinds=RIGS_WITH_PISTON,
        excluded=EXCLUDED_WITH_LOAD | EXCLUDED_WITH_VALVE_MAP,
    ),
    Condition("differential", "a thick rod", _constant_change(differential=True), kinds=RIGS_WITH_PISTON),
    Condition(
        "tank",
        "a vessel filled through a hose from a finite tank",
        _constant_change(tank=True),
        kinds=("valve",),
        excluded=EXCLUDED_WITH_TANK,
    ),
    Condition(
        "imposed",
        "a machine drives the piston slowly at held pressures, and its force is measured",
        _constant_change(imposed=True, rate=100.0),
        kinds=("friction",),
        excluded=EXCLUDED_WITH_IMPOSED_MOTION,
    ),
    Condition("messy", "several small unknown effects in every case", _constant_change(messy=True)),
    Condition(
        "rough",
        "several unknown effects of nearly full size in every case",
        _constant_change(messy=True, mess=(0.3, 1.0)),
    ),
    Condition(
        "uneven",
        "friction that warms up, a force over the stroke, a supply that ripples, a gain that drifts, all small",
        _constant_change(messy=True, mess_of=DRIFTING_AND_PERIODIC_EFFECTS),
    ),
    Condition("bits-#", "converters of so many bits", lambda bits: {"bits": int(bits)}, 8, 16),
    Condition(
        "no-acceleration",
        "not measured",
        _constant_change(absent=frozenset({"a"})),
        kinds=RIGS_WITH_PISTON,
        excluded=frozenset({"acceleration-bias"}),
    ),
    Condition("no-p2", "not measured", _constant_change(absent=frozenset({"p2"})), kinds=("axis",)),
    Condition("drift", "zeros of sensors wander", _constant_change(drift=4.0)),
    Condition("outliers", "one sample in 2000 is wrong", _constant_change(outliers=5e-4)),
    Condition(WIDE, "any of these, drawn anew for each case", _constant_change()),
)


def parse(text: str) -> Conditions:
    """Return the conditions of names joined by ``+``; raises InputError for unknown and incompatible names."""
    names = tuple(text.split("+"))
    found = [_find(name) for name in names]
    changes: dict[str, Any] = {}
    for _, change in found:
        if taken := set(change) & set(changes) - {"absent"}:
            raise InputError("--condition", text, f"one condition for {', '.join(sorted(taken))}", code="E031")
        changes |= change | {"absent": changes.get("absent", frozenset()) | change.get("absent", frozenset())}
    kinds = tuple(kind for kind in KINDS if all(kind in condition.kinds for condition, _ in found))
    if not kinds:
        raise InputError("--condition", text, "conditions that hold on one kind of rig", code="E031")
    excluded = frozenset[str]().union(*(condition.excluded for condition, _ in found))
    return replace(Conditions(names, kinds=kinds, excluded=excluded), **changes)


def draw_conditions(rng: np.random.Generator, effects: Sequence[str]) -> Conditions:
    """Draw several conditions under which all of these effects may be hidden."""
    while True:
        names = [str(rng.choice(line)) if rng.random() < 0.6 else USUAL for line in WIDE_CHOICES]
        try:
            conditions = parse("+".join(dict.fromkeys([WIDE, *(name for name in names if name != USUAL)])))
        except InputError:  # they are incompatible
            continue
        if all(conditions.allows(effect) for effect in effects):
            return conditions


def describe_conditions() -> str:
    """Return all patterns in one sentence, for the help."""
    return "; ".join(
        f"{c.pattern} ({c.description}" + (f", {c.minimum:g} to {c.maximum:g}" if c.maximum else "") + ")"
        for c in CONDITIONS
    )


def _find(name: str) -> tuple[Condition, dict[str, Any]]:
    for condition in CONDITIONS:
        change = condition.match(name)
        if change is not None:
            return condition, change
    forms = [condition.pattern for condition in CONDITIONS]
    wanted = f"one of {', '.join(forms)}, where # is a number, or several joined by +"
    raise InputError(
        "--condition", f'"{name}"', wanted, did_you_mean(re.sub(r"\d+(\.\d+)?", "#", name), forms), code="E031"
    )
