"""Noise draws of one run are cached for every model that is compared with it."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.simulate.outputs import sample_deviations
from tests.simulate.synthetic_experiments import make_experiment, model, time_grid, typical_values

NOISE = {"p1": NoiseModel(300.0, 0.0), "p2": NoiseModel(300.0, 0.0)}
E = replace(make_experiment("axis", time_grid(0.3), {"u": 1.0, "p1": 3e5, "p2": 2.5e5, "x": 0.1}), noise=NOISE)


def test_draws_differ_between_each_other_and_between_seeds() -> None:
    (one, _), (two, _) = E.noise_draws(2, 1)
    ((other, _),) = E.noise_draws(1, 2)
    assert not np.array_equal(one["p1"], two["p1"])
    assert not np.array_equal(one["p1"], other["p1"])


T = time_grid(1.0, 0.01)
SLOW = replace(
    make_experiment(
        "axis", T, {"u": np.where(T < 0.5, 2.0, -2.0), "p1": 3e5, "p2": 2.5e5, "x": 0.1}, restarts=range(0, 100, 10)
    ),
    noise=NOISE,
)  # a slow log of a fast piston


def test_longer_steps_suffice_for_how_far_noise_moves_a_run() -> None:
    """Of a run that takes a quarter of the steps: both runs of a difference err alike."""
    exact = replace(SLOW, longest_step=SLOW.max_step)
    assert SLOW.for_differences.max_step > 3.0 * exact.for_differences.max_step
    quick, slow = (sample_deviations(model(), one, 6) for one in (SLOW, exact))
    for channel in ("x", "p1", "p2"):
        assert np.std(quick[channel]) == pytest.approx(np.std(slow[channel]), rel=0.03)
        assert not np.array_equal(quick[channel], slow[channel])


def test_bristles_keep_the_short_steps() -> None:
    """They are stiff springs: with longer steps six draws erred by a tenth and more."""
    bristles = model(["presliding"], typical_values([catalogue()["presliding"]]))
    quick, slow = (sample_deviations(bristles, one, 2) for one in (SLOW, replace(SLOW, longest_step=SLOW.max_step)))
    assert all(np.array_equal(quick[channel], slow[channel]) for channel in slow)
