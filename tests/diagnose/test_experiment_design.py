"""What to record next: the manoeuvre in which two models differ most, in units of the sensors' noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pneucli.diagnose.experiment_design import MIN_SEPARATION, candidate_experiments, most_discriminating_experiment
from pneucli.identify.residuals import ChamberPressures, ResidualModel
from pneucli.noise import NoiseModel
from tests.simulate.synthetic_experiments import RIG, held_commands, make_experiment, model, time_grid

TIME = time_grid(2.0)
NOISE = {"p1": NoiseModel(500.0), "p2": NoiseModel(500.0), "x": NoiseModel(1e-5)}


def residual_models(kind: str, **signals) -> list[ResidualModel]:
    return [ChamberPressures(replace(make_experiment(kind, TIME, signals), noise=NOISE))]


DRIVEN = residual_models("axis", u=held_commands(TIME, [4.0, -4.0], 1.0))
PUSHED = residual_models("friction", p1=3e5)


def test_equal_models_are_not_separated():
    assert most_discriminating_experiment(model(), model(), DRIVEN) is None


def test_a_leak_shows_best_where_the_chamber_is_held():
    """An orifice of 0.02 mm^2 empties 100 cm^3 within the 30 s; while the valve is open it hides it."""
    leak = model(["chamber-leak"], {"chamber-leak.area": 2e-8})
    found = most_discriminating_experiment(model(), leak, DRIVEN)
    assert found is not None
    assert found.manoeuvre.kind in ("charge-and-hold", "discharge-and-hold")


def test_friction_that_grows_with_pressure_shows_over_three_pressures():
    grown = model(["pressure-friction"], {"pressure-friction.gain": 0.1})
    found = most_discriminating_experiment(model(), grown, PUSHED)
    assert found is not None
    assert found.channel in ("x", "a")


def test_a_difference_below_the_noise_is_not_called_a_separation():
    leak = model(["chamber-leak"], {"chamber-leak.area": 1e-13})
    assert most_discriminating_experiment(model(), leak, DRIVEN) is None
    assert MIN_SEPARATION > 1.0


@pytest.mark.parametrize(("seen", "kinds"), [(DRIVEN, {"axis"}), (PUSHED, {"friction"})])
def test_proposed_manoeuvres_suit_the_bench(seen: list[ResidualModel], kinds: set[str]):
    proposed = list(candidate_experiments(model(), seen))
    assert {e.recording.experiment for _, e in proposed} == kinds
    assert len({words for words, _ in proposed}) == len(proposed)
    for _, experiment in proposed:
        assert np.all(np.isfinite(experiment.inputs))
        if kinds == {"axis"}:
            assert np.abs(experiment.raw["u"]).max() <= 4.0  # no command beyond those recorded
        else:
            assert experiment.raw["p1"].min() > RIG.ambient_pressure
