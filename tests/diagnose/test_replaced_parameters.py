"""Effects that take the place of a parameter of the base model: a constant force where all motion has one direction."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pneucli.diagnose.evidence import replaced_base_parameters
from pneucli.identify.estimation.fit import fit
from pneucli.identify.estimation.model_fit import free_parameters
from pneucli.identify.residuals import ImposedMotion, ResidualModel
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording, Rig
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from tests.simulate.synthetic_experiments import VALVE

RIG = Rig(piston_area_1=1e-3, piston_area_2=1e-3, moving_mass=2.0, stroke=0.5)
TIME = 1e-3 * np.arange(8000)
COULOMB, VISCOUS, NOISE = 20.0, 100.0, 0.5
ONE_WAY = 0.03 + 0.02 * np.sin(2.0 * np.pi * TIME)
BOTH_WAYS = 0.1 * np.sin(np.pi * TIME) + 0.01


def driven(v: np.ndarray, stiffness: float) -> ResidualModel:
    rng, x = np.random.default_rng(4), 0.05 + np.cumsum(v) * 1e-3
    force = COULOMB * np.sign(v) + VISCOUS * v + stiffness * (x - 0.1) + rng.normal(scale=NOISE, size=TIME.size)
    signals = {"x": x, "v": v, "force": force}
    noise = {"x": NoiseModel(1e-7), "v": NoiseModel(1e-6), "force": NoiseModel(NOISE)}
    recording = Recording("given", "friction", "train", TIME, signals, noise, "open", "motion")
    return ImposedMotion(prepare(recording, RIG, None))


def replaced(v: np.ndarray, name: str, values: dict[str, float], stiffness: float = 0.0) -> tuple[str, ...]:
    made, effect = [driven(v, stiffness)], catalogue()[name]
    friction = {"friction.coulomb": 0.5 * COULOMB, "friction.viscous": VISCOUS}
    start = Model(RIG, (effect,), friction | {f"{name}.{key}": value for key, value in values.items()}, VALVE)
    return replaced_base_parameters(fit(start, made, free_parameters(start, made)), effect, made)


CASES: list[tuple[str, dict[str, Any]]] = [
    ("constant-force", {"force": -5.0}),
    ("friction-asymmetry", {"asymmetry": 0.3, "viscous_asymmetry": 0.0}),
]


@pytest.mark.parametrize(("name", "values"), CASES)
def test_in_one_direction_a_load_is_dry_friction(name: str, values: dict[str, float]) -> None:
    assert replaced(ONE_WAY, name, values) == ("friction.coulomb",)


@pytest.mark.parametrize(("name", "values"), CASES)
def test_in_both_directions_it_is_not(name: str, values: dict[str, float]) -> None:
    assert replaced(BOTH_WAYS, name, values) == ()


def test_a_spring_is_no_friction() -> None:
    assert replaced(ONE_WAY, "spring-force", {"stiffness": 200.0, "rest_position": 0.1}, stiffness=300.0) == ()
