"""Rests on a stop tell nothing: without them every answer about the piston is the same.

The spring is in no description of the rig, so that it presses a piston onto its stop against what the pressures say.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.diagnosis import diagnose
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.friction.identification import FrictionIdentification, identify_friction
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import residual_models
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording, Rig
from pneucli.simulate.end_stops import with_end_stops
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities
from tests.simulate.spring_return import ACTUATOR, CYLINDER, Piston, motions, recordings

SPRING = catalogue()["spring-force"]
TRIED = ("spring-force", "constant-force", "position-friction", "friction-hysteresis", "stribeck", "dwell-breakaway")
PISTONS = pytest.mark.parametrize("piston", [CYLINDER, ACTUATOR], ids=["cylinder", "actuator"])


def as_recorded(piston: Piston) -> list[Recording]:
    return recordings(piston)


def cut(piston: Piston) -> list[Recording]:
    return [part for one in recordings(piston) for part in motions(one, piston)]


def ready(recorded: Sequence[Recording], rig: Rig) -> list[Experiment]:
    return with_end_stops([prepare(one, rig, 0.5) for one in recorded], rig)


@cache
def experiments(piston: Piston, *, without_rests: bool = False) -> list[Experiment]:
    return ready(cut(piston) if without_rests else as_recorded(piston), piston.rig())


@cache
def fitted(piston: Piston, *, without_rests: bool = False) -> Fit:
    train = [e for e in experiments(piston, without_rests=without_rests) if e.recording.use == "train"]
    return fit_model(guess_base_model(train, piston.rig()), residual_models(train), [SPRING])


@cache
def friction(piston: Piston, *, without_rests: bool = False) -> FrictionIdentification:
    known = {
        "spring-force.stiffness": piston.stiffness,
        "spring-force.rest_position": -piston.preload / piston.stiffness,
    }
    model = Model(piston.rig(), (SPRING,), known)
    return identify_friction(cut(piston) if without_rests else as_recorded(piston), model, nodes=50)


@PISTONS
def test_much_of_these_recordings_is_rest_on_a_stop(piston: Piston) -> None:
    for e in experiments(piston):
        assert 0.1 < np.mean(~e.is_free) < 0.8


@PISTONS
@pytest.mark.parametrize(("stated", "shift"), [(1.0, 0.0), (1.03, 0.0), (None, 0.0), (None, -0.4), (1.0, -0.4)])
def test_stops_are_found_though_the_pressures_push_the_piston_off_them(
    piston: Piston, stated: float | None, shift: float
) -> None:
    """With the stroke stated, not stated, and a position that is not zero at the end."""
    rig = piston.rig(stroke=None if stated is None else stated * piston.stroke)
    zero = shift * piston.stroke
    moved = [replace(r, signals={**r.signals, "x": r["x"] + zero}) for r in as_recorded(piston)]
    assert ready(moved, rig)[0].detected_ends == pytest.approx((zero, zero + piston.stroke), abs=5e-5)


@pytest.mark.parametrize("stated", [None, "near", "far"])
def test_a_piston_that_spring_and_friction_hold_at_its_extremes_rests_on_no_stop(stated: str | None) -> None:
    """The stops are out of reach. A stroke as long as the motion, or a longer one, is stated, or none."""
    held = replace(CYLINDER, stroke=0.3, preload=-90.0, start=0.1)
    recorded = recordings(held)
    lowest, highest = (edge([edge(r["x"]) for r in recorded]) for edge in (np.min, np.max))
    shifted = [replace(r, signals={**r.signals, "x": r["x"] - lowest}) for r in recorded]
    rig = held.rig(stroke={"near": highest - lowest, "far": held.stroke}.get(stated or ""))
    assert ready(shifted, rig)[0].detected_ends == (-np.inf, np.inf)


@PISTONS
@pytest.mark.parametrize("without_rests", [False, True])
def test_the_fit_finds_the_spring_and_the_damper(piston: Piston, *, without_rests: bool) -> None:
    found = fitted(piston, without_rests=without_rests)
    rest = -piston.preload / piston.stiffness
    assert found["spring-force.stiffness"].value == pytest.approx(piston.stiffness, rel=2e-3)
    assert found["spring-force.rest_position"].value == pytest.approx(rest, rel=2e-3)
    assert found["friction.viscous"].value == pytest.approx(piston.viscous, rel=1e-2)
    assert found["friction.coulomb"].value == pytest.approx(piston.coulomb, rel=1e-2, abs=1e-3 * piston.preload)
    shown = np.count_nonzero(found.residual)
    assert found.cost < 1.3 * shown


@PISTONS
def test_the_fit_is_the_same_without_the_rests(piston: Piston) -> None:
    for one in fitted(piston).estimates:
        other = fitted(piston, without_rests=True)[one.name]
        assert abs(one.value - other.value) < 3.0 * np.hypot(one.error, other.error)


@PISTONS
def test_the_guess_and_the_scales_are_the_same_without_the_rests(piston: Piston) -> None:
    models = [guess_base_model(experiments(piston, without_rests=w), piston.rig()) for w in (False, True)]
    assert models[0].values == pytest.approx(models[1].values, rel=0.3, abs=1.0)
    first, second = (
        rig_quantities(m, experiments(piston, without_rests=w)) for m, w in zip(models, (False, True), strict=True)
    )
    assert (first.x_min, first.x_max, first.force) == pytest.approx(
        (second.x_min, second.x_max, second.force), abs=2e-4 * piston.stroke
    )


@PISTONS
@pytest.mark.parametrize("without_rests", [False, True])
def test_the_diagnosis_names_the_spring_alone(piston: Piston, *, without_rests: bool) -> None:
    chosen = experiments(piston, without_rests=without_rests)
    train, held_out = (residual_models([e for e in chosen if e.recording.use == use]) for use in ("train", "test"))
    effects = {name: catalogue()[name] for name in TRIED}
    base = fit_model(guess_base_model([v.experiment for v in train], piston.rig()), train, [])
    found = diagnose(DiagnosisData(train, held_out, effects), base)
    assert (found.verdict, found.missing) == ("missing-effect", ("spring-force",))


@PISTONS
def test_friction_over_velocity_is_the_same_without_the_rests(piston: Piston) -> None:
    whole, parts = friction(piston), friction(piston, without_rests=True)
    for name, one in whole.parameters.items():
        other = parts.parameters[name]
        assert max(one.low, other.low) <= min(one.high, other.high), name
    assert whole.parameters["viscous"].value == pytest.approx(piston.viscous, rel=0.02)


@PISTONS
def test_a_friction_model_does_not_push_the_piston_beyond_its_stop(piston: Piston) -> None:
    """On the stop up to 2,400 N press on it; the simulation starts again where it leaves."""
    assert all(d.percent < 2.0 for d in friction(piston).deviations)
