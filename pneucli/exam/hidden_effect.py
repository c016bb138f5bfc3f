"""One effect that an exam may hide: where it acts, which parameters of the rig carry it, and how its size is drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

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

    """

    name: str
    kinds: tuple[Kind, ...]
    fields: dict[str, tuple[str, float]]
    null_values: dict[str, float]
    draw: Draw
    inverse: bool = False
    part: str = ""
    variable: str = ""

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


def si_effect(name: str, kinds: tuple[Kind, ...], draw: Draw, scaled: dict[str, float], **fields: str) -> HiddenEffect:
    """Return an effect of the catalogue in SI: ``scaled`` has null values, ``fields`` the rig's field by parameter."""
    return HiddenEffect(name, kinds, {key: (field, 1.0) for key, field in fields.items()}, scaled, draw)


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


def draw_scale(_: Parameters, rng: np.random.Generator) -> dict[str, float]:
    """Draw a scale error of the pressure sensors of 4 to 8 %, with either sign."""
    return {"pressure_scale": 1.0 + rng.uniform(0.04, 0.08) * float(rng.choice([-1.0, 1.0]))}


def disturbance(name: str, kinds: tuple[Kind, ...], part: str, variable: str, scaled: str, draw: Draw) -> HiddenEffect:
    """Return an effect outside the catalogue; ``scaled`` names the rig's fields that scale with the size."""
    return HiddenEffect(name, kinds, {}, dict.fromkeys(scaled.split(), 0.0), draw, part=part, variable=variable)
