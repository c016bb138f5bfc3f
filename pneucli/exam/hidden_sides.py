"""Effects of the catalogue at one side: of either chamber, its hose or its sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from pneucli.exam.hidden_effect import AXIS, HiddenEffect
from pneucli.exam.hidden_effects import BY_NAME
from pneucli.exam.rig.parameters import Parameters

if TYPE_CHECKING:
    import numpy as np

OF_CHAMBER_1 = ("chamber-leak", "laminar-leak", "opening-leak", "dead-volume", "pressure-offset")
OF_BOTH = ("line-delay", "pressure-scale")

# each effect that has a side, with its names at chamber 1 and at chamber 2
SIDES = {name: (name, f"{name}:2") for name in OF_CHAMBER_1} | {name: (f"{name}:1", f"{name}:2") for name in OF_BOTH}


def on_side(effect: HiddenEffect, side: int) -> HiddenEffect:
    """Return an effect at one side; the rig's fields of a side end with its number."""

    def draw(par: Parameters, rng: np.random.Generator) -> dict[str, float]:
        return {f"{field}_{side}": value for field, value in effect.draw(par, rng).items()}

    return replace(
        effect,
        name=f"{effect.name}:{side}",
        kinds=AXIS,
        fields={name: (f"{field}_{side}", factor) for name, (field, factor) in effect.fields.items()},
        null_values={f"{field}_{side}": null for field, null in effect.null_values.items()},
        draw=draw,
    )


ON_A_SIDE = tuple(
    on_side(BY_NAME[name], int(sided[-1]))
    for name, names in SIDES.items()
    for sided in names
    if sided != name  # at chamber 1 most are declared without a side
)
ALL_BY_NAME = BY_NAME | {effect.name: effect for effect in ON_A_SIDE}
"""Every effect that an exam may hide, those at a side included."""


def draw_sides(names: Sequence[str], rng: np.random.Generator) -> tuple[str, ...]:
    """Return the names of these effects at a drawn side, where they have one."""
    return tuple(SIDES[name][int(rng.random() < 0.5)] if name in SIDES else name for name in names)
