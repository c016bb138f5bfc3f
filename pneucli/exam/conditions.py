"""The conditions under which the cases of an exam are recorded; each has a name, such as ``rate-200Hz``, and a row in
``conditions.toml``.

Names joined by ``+`` hold together. The usual conditions are a bore near 32 mm, 7 bar and 1 kHz.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Literal

from pneucli.errors import InputError, did_you_mean
from pneucli.exam.hidden_effects import ALL_BY_NAME, BY_NAME, CATALOGUE, FRICTION, SIDES, UNCATALOGUED, VALVE

if TYPE_CHECKING:
    import numpy as np

USUAL, WIDE = "usual", "wide"
WIDE_SHARE = 0.6  # of the lines, from which "wide" draws one condition each
Kind = Literal["valve", "friction", "axis"]
KINDS: tuple[Kind, ...] = ("valve", "friction", "axis")


@dataclass(frozen=True)
class Condition:
    """One kind of condition, a row of ``conditions.toml``.

    Attributes:
        pattern: Its name, in which ``#`` is a number.
        description: What it is.
        change: The fields of :class:`Conditions` that it sets.
        number: The field that the number sets (``sets``), its factor to SI, its limits (``from``, ``to``).
        kinds: The kinds of rig that can have it.
        excluded: Effects that are not identifiable under it.
    """

    pattern: str
    description: str
    change: Mapping[str, Any]
    number: Mapping[str, Any]
    kinds: tuple[Kind, ...]
    excluded: frozenset[str]

    def match(self, name: str) -> dict[str, Any] | None:
        """Return the changes for ``name``; None where the pattern differs. Raises InputError beyond the limits."""
        found = re.fullmatch(re.escape(self.pattern).replace(r"\#", r"(\d+(?:\.\d+)?)"), name)
        if found is None or not self.number:
            return None if found is None else dict(self.change)
        value, low, high = float(found[1]), self.number["from"], self.number["to"]
        if not low <= value <= high:
            raise InputError("--condition", name, f"{self.pattern} with # from {low:g} to {high:g}", code="E031")
        value = value * self.number["factor"]
        return {self.number["sets"]: int(value) if self.number.get("whole") else value}


def _group(names: Iterable[str]) -> frozenset[str]:
    """Return the names of effects, those of groups (``@NAME``) in place of the group."""
    return frozenset(one for name in names for one in (GROUPS[name[1:]] if name.startswith("@") else (name,)))


def _condition(pattern: str, row: Mapping[str, Any]) -> Condition:
    change: dict[str, Any] = {name: None if value == "none" else value for name, value in row.get("change", {}).items()}
    change |= {name: _group(change[name]) for name in ("absent", "mess_of") if name in change}
    change |= {"mess": tuple(change["mess"])} if "mess" in change else {}
    kinds = tuple(row.get("rigs", KINDS))
    return Condition(pattern, row["description"], change, row.get("number", {}), kinds, _group(row.get("excluded", ())))


_TABLE = tomllib.loads(files("pneucli.exam").joinpath("conditions.toml").read_text(encoding="utf-8"))
WIDE_CHOICES: Sequence[Sequence[str]] = _TABLE["wide"]
GROUPS: dict[str, frozenset[str]] = {
    **{name: frozenset(effects) for name, effects in _TABLE["groups"].items()},
    "sides": frozenset(effect.name for effect in CATALOGUE) - frozenset(SIDES),
    # of the chamber, the valve and its supply
    "no-area": frozenset(
        e.name for e in CATALOGUE if VALVE[0] in e.kinds and FRICTION[0] not in e.kinds and not e.under
    )
    | {"piston-leak", "dead-volume", "valve-deadband"}
    | {effect.name for effect in UNCATALOGUED if effect.part == "flow"},
}
CONDITIONS = tuple(_condition(pattern, row) for pattern, row in _TABLE["conditions"].items())


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
    hose: bool = False  # between valve and chamber, with a bore
    imposed: bool = False  # a machine imposes the motion and its force is measured
    constant_speed: bool = False  # at one speed in one direction for each recording
    encoder: bool = False  # of a drawn resolution
    wall_heat: bool = False
    free_ratio: bool = False  # a drawn critical ratio of the valve, which the pipeline file leaves open
    bench_test: bool = True  # of the valve
    sides: bool = False  # effects of either chamber
    held: bool = False  # the controller holds its command for several milliseconds
    source: str | None = None  # "regulated" or "pump", in place of a valve whose command sets an area
    source_stated: bool = False  # in the pipeline file
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
        return self.messy or self.drift > 0.0 or (self.source is not None and not self.source_stated)

    def allows(self, effect: str) -> bool:
        """Whether the effect may be hidden under these conditions."""
        under = ALL_BY_NAME[effect].under
        return effect not in self.excluded and (not under or bool(getattr(self, under)))

    def allows_small(self, effect: str) -> bool:
        """Whether this disturbance may act as well."""
        return self.allows(effect) and (not self.mess_of or effect in self.mess_of)


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
    conditions = replace(Conditions(names, kinds=kinds, excluded=excluded), **changes)
    if wrong := _contradiction(conditions):
        raise InputError("--condition", text, wrong, code="E031")
    if conditions.sides and conditions.valve is None:  # one hose alone shows where the other one is filled as well
        return replace(conditions, excluded=excluded | {"line-delay"})
    return conditions


def _contradiction(conditions: Conditions) -> str:
    """Return what two conditions need that exclude each other; "" where they do not."""
    if conditions.sides and "p2" in conditions.absent:
        return "p2 recorded, for effects of chamber 2"
    if conditions.tank and conditions.free_ratio:
        return "one critical ratio: a tank's hose has its own"
    if conditions.hose and (conditions.tank or conditions.sides or conditions.source == "pump"):
        return "one hose for each valve of one kind"
    if conditions.source and conditions.held:
        return "commands logged with the rows of the steady bench"
    if conditions.source and (conditions.wall_heat or conditions.free_ratio or conditions.switching or conditions.load):
        return "a valve whose command sets an area"
    return ""


def draw_conditions(rng: np.random.Generator, effects: Sequence[str]) -> Conditions:
    """Draw a kind of rig and several conditions under which all of these effects may be hidden.

    The lines of ``wide`` are taken in random order, and what contradicts an earlier one is left out: no condition is
    rare because many others exclude it.
    """
    kind = rng.choice([kind for kind in KINDS if all(kind in BY_NAME[effect].kinds for effect in effects)])
    drawn, found = dict[int, str](), parse(WIDE)
    for line in rng.permutation(len(WIDE_CHOICES)).tolist():
        name = str(rng.choice(WIDE_CHOICES[line])) if rng.random() < WIDE_SHARE else USUAL
        if name == USUAL:
            continue
        more = drawn | {line: name}
        try:
            together = parse("+".join([WIDE, *(more[one] for one in sorted(more))]))
        except InputError:  # they are incompatible
            continue
        if kind in together.kinds and all(together.allows(effect) for effect in effects):
            drawn, found = more, together
    return found


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
