"""Effects that take the place of a parameter of the base model: a constant force where all motion has one direction."""

from dataclasses import dataclass
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


@dataclass(frozen=True)
class Truth:
    """Dry friction, its growth with each bar, a spring and a load; between equal pressures of 2 to 4 bar."""

    coulomb: float = COULOMB
    gain: float = 0.0
    stiffness: float = 0.0
    load: float = 0.0

    def residual_model(self, v: np.ndarray) -> ResidualModel:
        """The motion ``v`` (n,) of a piston, and the force that drives it."""
        rng, x, above = np.random.default_rng(4), 0.05 + np.cumsum(v) * 1e-3, 3.0 + np.cos(2.1 * TIME)
        dry = self.coulomb * (1.0 + 2.0 * self.gain * above) * np.sign(v)
        force = dry + VISCOUS * v + self.stiffness * (x - 0.1) + self.load + rng.normal(scale=NOISE, size=TIME.size)
        signals = {"x": x, "v": v, "force": force}
        signals |= dict.fromkeys(("p1", "p2"), RIG.ambient_pressure + 100000.0 * above)
        noise = {"x": 1e-7, "v": 1e-6, "force": NOISE, "p1": 100.0, "p2": 100.0}
        models = {name: NoiseModel(rms) for name, rms in noise.items()}
        recording = Recording("given", "friction", "train", TIME, signals, models, "open", "motion")
        return ImposedMotion(prepare(recording, RIG, None))


def replaced(v: np.ndarray, name: str, values: dict[str, float], truth: Truth = Truth()) -> tuple[str, ...]:
    made, effect = [truth.residual_model(v)], catalogue()[name]
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
    assert replaced(ONE_WAY, "spring-force", {"stiffness": 200.0, "rest_position": 0.1}, Truth(stiffness=300.0)) == ()


def test_friction_that_grows_with_pressure_is_told_from_friction_that_does_not() -> None:
    """Pressures of 2 to 4 bar above ambient change friction much alike; but the data determine both."""
    assert replaced(BOTH_WAYS, "pressure-friction", {"gain": 0.1}, Truth(gain=0.1)) == ()


def test_a_parameter_that_an_effect_makes_needless_is_replaced() -> None:
    """One part in fifty of the motion goes back. Data tell a load and friction, but not a load alone from friction."""
    v = np.where(TIME % 2.0 < 0.04, -0.02, ONE_WAY)
    assert replaced(v, "constant-force", {"force": 15.0}, Truth(coulomb=0.0, load=20.0)) == ("friction.coulomb",)
    assert replaced(v, "constant-force", {"force": 15.0}, Truth(load=20.0)) == ()


@pytest.mark.parametrize(("coulomb", "gain"), [(0.1, 0.3), (1.0, 10.0)])
def test_what_an_effect_multiplies_is_never_needless(coulomb: float, gain: float) -> None:
    """The dry friction at 0 bar is uncertain, or a small part; but where it is none it cannot grow with pressure."""
    truth = Truth(coulomb=coulomb, gain=gain)
    assert replaced(BOTH_WAYS, "pressure-friction", {"gain": gain}, truth) == ()
