"""Other readings of one run: drawn once, whatever model is held against them."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.noise import NoiseModel
from pneucli.simulate import experiment as made
from pneucli.simulate.noise_propagation import sample_deviations
from tests.simulate.synthetic_experiments import make_experiment, model, time_grid

NOISE = {"p1": NoiseModel(300.0, 0.0), "p2": NoiseModel(300.0, 0.0)}
E = replace(make_experiment("axis", time_grid(0.3), {"u": 1.0, "p1": 3e5, "p2": 2.5e5, "x": 0.1}), noise=NOISE)


def test_readings_that_are_kept_are_those_that_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = sample_deviations(model(), E, 2)
    assert E.noise_draws(2, 20151) is E.noise_draws(2, 20151)
    monkeypatch.setattr(made, "MAX_CACHE_BYTES", 0)
    fresh = E.with_restarts(None)
    assert fresh.noise_draws(2, 20151) is not fresh.noise_draws(2, 20151)
    again = sample_deviations(model(), fresh, 2)
    assert all(np.array_equal(kept[c], again[c]) for c in kept)


def test_other_draws_are_other_readings() -> None:
    (one, _), (two, _) = E.noise_draws(2, 1)
    ((other, _),) = E.noise_draws(1, 2)
    assert not np.array_equal(one["p1"], two["p1"])
    assert not np.array_equal(one["p1"], other["p1"])
