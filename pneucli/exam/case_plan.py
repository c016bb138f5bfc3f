"""Plan which effects each case of an exam hides, on which kind of rig."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.exam.conditions import WIDE, Conditions, draw_conditions
from pneucli.exam.hidden_effect import HiddenEffect
from pneucli.exam.hidden_effects import BY_NAME, CATALOGUE, UNCATALOGUED
from pneucli.exam.hidden_sides import draw_sides


@dataclass(frozen=True)
class PlannedCase:
    """What one case hides, on which kind of rig."""

    kind: str
    hidden: tuple[str, ...]
    outside: str
    seed: int
    conditions: Conditions


def plan_cases(cases: int, nulls: int, conditions: Conditions, seed: int) -> Iterator[PlannedCase]:
    """Yield which effects each case hides, on which kind of rig, and under which conditions."""
    rng, conditions_rng = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    singles, disturbances = (_effect_names(effects, conditions, rng) for effects in (CATALOGUE, UNCATALOGUED))
    for k in range(cases + nulls):
        hidden: tuple[str, ...] = ()
        outside = ""
        if k < cases and k % 6 == 5:
            hidden = _pair(conditions, rng)
        elif k < cases and k % 5 == 4:
            outside = next(disturbances)
        elif k < cases:
            hidden = (next(singles),)
        names = [*hidden, *([outside] if outside else [])]
        of_case = conditions
        while WIDE in of_case.names and (of_case is conditions or not _kinds(names, of_case)):
            of_case = draw_conditions(conditions_rng, names)
        kind = str(rng.choice(_kinds(names, of_case)))
        sided = draw_sides(hidden, conditions_rng) if of_case.sides else hidden
        yield PlannedCase(kind, sided, outside, int(rng.integers(2**31)), of_case)


def _effect_names(effects: Sequence[HiddenEffect], conditions: Conditions, rng: np.random.Generator) -> Iterator[str]:
    while True:
        order = [effects[i].name for i in rng.permutation(len(effects))]
        yield from (name for name in order if conditions.allows(name) and _kinds([name], conditions))


def _pair(conditions: Conditions, rng: np.random.Generator) -> tuple[str, ...]:
    kind = str(rng.choice(conditions.kinds))
    names = [effect.name for effect in CATALOGUE if kind in effect.kinds and conditions.allows(effect.name)]
    return tuple(str(name) for name in rng.choice(names, 2, replace=False))


def _kinds(names: Sequence[str], conditions: Conditions) -> list[str]:
    return [kind for kind in conditions.kinds if all(kind in BY_NAME[name].kinds for name in names)]
