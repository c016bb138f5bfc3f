"""Friction from the balance of forces, without a simulation, against the exam's rig; and fits that start from it."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.estimation.score_test import direct_base_friction, direct_guesses
from pneucli.identify.guesses.base_model import guess_base_model, guess_friction
from pneucli.identify.guesses.direct_friction import (
    ForceSamples,
    _slides,
    direct_friction,
    force_samples,
    has_both_directions,
    search_stribeck,
)
from pneucli.identify.residuals import residual_models
from pneucli.physics.effects import catalogue
from pneucli.physics.vectorised import stribeck_friction
from pneucli.recording import ParameterPrior
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities
from tests.identify_friction.synthetic_recordings import BENCH, RIG, pressed, pulses, recorded
from tests.simulate.synthetic_experiments import model

STICKY = BENCH._replace(static=20.0, stribeck_velocity=0.02)
STRIBECK = catalogue()["stribeck"]


def one_way(peak: float = 24.0, seed: int = 1, **changed: float) -> Experiment:
    """A stick-slip toward +x alone: the force rises and falls back between rests."""
    rig = STICKY._replace(**changed)
    force = np.maximum(pulses(3, peak), 0.0)
    return prepare(recorded(rig, pressed(rig, force), seed), RIG, 0.5)


def test_motion_in_one_direction_does_not_hide_coulomb_friction_behind_a_constant_force() -> None:
    found = guess_friction([one_way()], RIG)
    assert found["friction.coulomb"] == pytest.approx(12.0, rel=0.35)


def test_both_branches_are_found_without_a_simulation() -> None:
    samples = force_samples([one_way(drop=0.25), one_way(26.0, 2, drop=0.25)], 2.0)
    assert not has_both_directions(samples.v)
    (found,) = direct_friction(samples, two_branches=True)
    assert found["coulomb"] == pytest.approx(12.0, rel=0.1)
    assert found["viscous"] == pytest.approx(40.0, rel=0.2)
    assert found["static"] == pytest.approx(20.0, rel=0.1)
    assert found["velocity"] == pytest.approx(0.02, rel=0.4)
    assert found["drop"] == pytest.approx(0.25, abs=0.08)


def test_too_few_samples_give_no_start() -> None:
    few = ForceSamples(np.ones(50), np.ones(50), np.ones(50))
    assert direct_friction(few, two_branches=False) == []
    assert direct_friction(force_samples([], 1.0), two_branches=False) == []


def test_a_search_finds_stribeck_friction_and_a_constant_force_beside_it() -> None:
    v = np.concatenate([np.geomspace(1e-3, 0.3, 400), -np.geomspace(1e-3, 0.3, 400)])
    friction = stribeck_friction(v, 5.0, 30.0, 9.0, 0.02)
    found = search_stribeck(v, friction + 1.5, 1.0, offset=True)
    assert found == pytest.approx([5.0, 30.0, 9.0, 0.02, 1.5], rel=0.15)
    rising = 5.0 * np.sign(v) - 3.0 * np.sign(v) / (1.0 + (v / 0.02) ** 2)
    assert search_stribeck(v, rising, 1.0, offset=False) is None


def test_what_smoothing_leaves_beside_a_stop_is_no_slide() -> None:
    v = np.concatenate([np.zeros(20), np.full(30, 0.2), np.full(4, -0.05), np.zeros(20)])
    assert np.flatnonzero(_slides(v, 3)).tolist() == list(range(20, 47))


def test_a_fit_without_coulomb_friction_starts_again_from_the_balance_of_forces() -> None:
    experiments = [one_way(), one_way(26.0, 2)]
    views = residual_models(experiments)
    lost = guess_base_model(experiments, RIG).with_values({"friction.coulomb": 0.0, "friction.viscous": 400.0})
    values = direct_base_friction(lost, views)
    assert all(v["friction.coulomb"] > 0.0 for v in values)
    found = fit_model(lost, views, [STRIBECK])
    assert found["friction.coulomb"].value == pytest.approx(12.0, rel=0.05)
    assert found["stribeck.static"].value == pytest.approx(20.0, rel=0.05)


def test_stribeck_friction_has_a_scale_without_coulomb_friction() -> None:
    none = rig_quantities(model(values={"friction.coulomb": 0.0}))
    assert none.coulomb == pytest.approx(0.02 * none.force)
    assert STRIBECK.parameters[0].range_on(none).typical


def test_what_the_pipeline_file_states_takes_the_place_of_direct_values() -> None:
    experiments = [one_way()]
    views = residual_models(experiments)
    known = {
        "stribeck.static": ParameterPrior("N", fixed=17.0),
        "friction.viscous": ParameterPrior("N s/m", lower=0.0, upper=5.0),
    }
    start = guess_base_model(experiments, RIG)
    found = direct_guesses(STRIBECK, replace(start, rig=replace(RIG, priors=known)), views)
    assert found
    assert all(values["stribeck.static"] == 17.0 for values in found)
    assert all(values["friction.viscous"] == 5.0 for values in found)
    assert direct_guesses(catalogue()["constant-force"], start, views) == []
