"""The effects that an exam may hide, at either side: those of the catalogue, and disturbances that none names.

``hidden_effects.toml`` lists them: where each acts, which parameters of the rig carry it, and how its size is drawn. A
size of 1 is about that of the shared example cases; a third of it is a third of the distance from null.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from pneucli.exam.rig.parameters import Parameters

if TYPE_CHECKING:  # `pneucli exam --help` lists conditions, which exclude effects, without numpy
    import numpy as np

Kind = str
Draw = Callable[[Parameters, "np.random.Generator"], dict[str, float]]

VALVE, FRICTION, AXIS = ("valve",), ("friction",), ("axis",)
RIGS_WITH_VALVE, RIGS_WITH_PISTON, ALL_RIGS = VALVE + AXIS, FRICTION + AXIS, VALVE + FRICTION + AXIS


@dataclass(frozen=True)
class HiddenEffect:
    """One effect that an exam may hide.

    Attributes:
        name: The effect's name.
        kinds: The kinds of rig on which it is visible.
        fields: The rig's field for each parameter of the catalogue, with the factor from the catalogue's unit to SI.
        null_values: The rig's fields that scale with the size, with their null values.
        draw: Draws the rig's fields at full size.
        inverse: Whether the effect is null at infinity.
        part: Of an effect outside the catalogue: where it acts (force, flow or sensor).
        variable: Of an effect outside the catalogue: the signal of which it is a function.
        under: The field of the conditions without which it does not show; "" where it always does.

    """

    name: str
    kinds: tuple[Kind, ...]
    fields: dict[str, tuple[str, float]]
    null_values: dict[str, float]
    draw: Draw
    inverse: bool = False
    part: str = ""
    variable: str = ""
    under: str = ""

    def apply(self, par: Parameters, size: float, rng: np.random.Generator) -> Parameters:
        """Return the rig with this effect of the given size."""
        values = self.draw(par, rng)
        for field, null in self.null_values.items():
            base = par.coulomb if field == "static" else null
            values[field] = values[field] / size if self.inverse else base + size * (values[field] - base)
        return par._replace(**values)

    def true_parameters(self, par: Parameters) -> dict[str, float]:
        """The parameters in the catalogue's names and units."""
        return {name: float(getattr(par, field)) / factor for name, (field, factor) in self.fields.items()}


def around(**centres: float) -> Draw:
    """Draw every field within 25 % of its centre."""
    return lambda _, rng: {name: centre * rng.uniform(0.75, 1.25) for name, centre in centres.items()}


def either_sign(**centres: float) -> Draw:
    """Draw every field within 25 % of its centre, with either sign."""

    def draw(_: Parameters, rng: np.random.Generator) -> dict[str, float]:
        return {k: c * rng.uniform(0.75, 1.25) * float(rng.choice([-1.0, 1.0])) for k, c in centres.items()}

    return draw


def draw_stribeck(par: Parameters, rng: np.random.Generator) -> dict[str, float]:
    """Draw static friction of 1.6 to 2.1 times the Coulomb friction, and the Stribeck velocity in m/s."""
    return {"static": par.coulomb * rng.uniform(1.6, 2.1), "stribeck_velocity": rng.uniform(0.01, 0.025)}


def draw_hysteresis(par: Parameters, rng: np.random.Generator) -> dict[str, float]:
    """Draw the drops of dry and viscous friction.

    Where friction falls with speed, half of the rigs lose only that rise (6.21) of the dry friction. Half of all rigs
    lose no viscous friction.
    """
    drop = 0.45 * rng.uniform(0.75, 1.25)
    drop = 0.0 if par.static > par.coulomb and rng.random() < 0.5 else drop
    return {"drop": drop, "viscous_drop": 0.0 if rng.random() < 0.5 else 0.4 * rng.uniform(0.75, 1.25)}


def draw_patch(_: Parameters, rng: np.random.Generator) -> dict[str, float]:
    """Draw a stretch of the stroke of 15 to 30 mm with additional friction."""
    start = rng.uniform(0.06, 0.12)
    end = start + rng.uniform(0.015, 0.03)
    return {"position_from": start, "position_to": end, "position_gain": rng.uniform(1.0, 1.8)}


def draw_spring(_: Parameters, rng: np.random.Generator) -> dict[str, float]:
    """Draw stiffness in N/m and rest position in m of a spring."""
    return {"spring_stiffness": rng.uniform(150, 300), "spring_rest": rng.uniform(0.03, 0.17)}


def draw_payload(par: Parameters, rng: np.random.Generator) -> dict[str, float]:
    """Draw a payload of 40 to 80 % of the moving mass, in kg."""
    return {"extra_mass": par.mass * rng.uniform(0.4, 0.8)}


def draw_loop(par: Parameters, rng: np.random.Generator) -> dict[str, float]:
    """Draw the span and the band in Pa of a valve with a pressure loop, shares of the supply above ambient."""
    gauge = par.supply - par.ambient
    return {"regulated_span": gauge * rng.uniform(0.8, 0.95), "regulated_band": gauge * rng.uniform(0.06, 0.12)}


def draw_scale(_: Parameters, rng: np.random.Generator) -> dict[str, float]:
    """Draw a scale error of the pressure sensors of 4 to 8 %, with either sign."""
    return {"pressure_scale": 1.0 + rng.uniform(0.04, 0.08) * float(rng.choice([-1.0, 1.0]))}


def _declared(name: str, row: dict[str, Any]) -> HiddenEffect:
    """Return the effect of a row of the table."""
    if centres := row.get("around"):
        draw = around(**centres)
    elif centres := row.get("either_sign"):
        draw = either_sign(**centres)
    else:
        draw = globals()[f"draw_{row['draw']}"]
    fields = {key: (field, 1.0) if isinstance(field, str) else tuple(field)
              for key, field in row.get("parameters", {}).items()}  # fmt: skip
    about = {key: row[key] for key in ("inverse", "part", "variable", "under") if key in row}
    return HiddenEffect(name, tuple(row.get("rigs", ALL_RIGS)), fields, row.get("null", {}), draw, **about)


_TABLE = files("pneucli.exam").joinpath("hidden_effects.toml")
BY_NAME = {name: _declared(name, row) for name, row in tomllib.loads(_TABLE.read_text(encoding="utf-8")).items()}
CATALOGUE = tuple(effect for effect in BY_NAME.values() if not effect.part)
UNCATALOGUED = tuple(effect for effect in BY_NAME.values() if effect.part)

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
