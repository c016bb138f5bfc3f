"""A piston that rests against its ends most of the time: the end carries it, not friction."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pneucli.compare import compare
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.diagnosis import diagnose
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.friction.identification import FrictionIdentification, identify_friction
from pneucli.identify.guesses.base_model import guess_base_model, guess_friction
from pneucli.identify.guesses.direct_friction import force_samples
from pneucli.identify.residuals import residual_models
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.end_stops import with_end_stops
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import with_estimated_pressures
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.run import run
from tests.identify.test_arrangements import FIRST, NOISE, SECOND
from tests.simulate.spring_return import ACTUATOR, CYLINDER, Piston, motions, recordings
from tests.simulate.synthetic_experiments import FRICTION, RIG

STROKE = 0.05  # m
SHORT = replace(RIG, stroke=STROKE, valve_arrangement="5/3")
PERIOD = 1e-3
TRUE = Model(SHORT, (), FRICTION, FIRST, SECOND)


def to_and_fro(
    rig: Rig = SHORT, seed: int = 3, dwell: float = 1.0, stiffness: float = np.inf, rebound: float = 0.0
) -> Experiment:
    """Full steps of a 5/3 valve: the piston crosses its stroke and waits at the end for the next.

    An end with a ``stiffness`` (N/m) gives way under what presses the piston against it; where the piston arrives, it
    gives way by ``rebound`` (m) and throws it back.
    """
    levels = np.repeat([4.0, -4.0, 3.0, -3.0], round(dwell / PERIOD))
    time, rng = PERIOD * np.arange(levels.size), np.random.default_rng(seed)
    start = {"p1": 2e5, "p2": 2e5, "x": 0.02, "v": 0.0, "p_supply": 7e5}
    flat = {name: np.full(time.size, value) for name, value in start.items()}
    blank = Recording(
        "axis", "axis", "train", time, {"u": levels} | flat, dict.fromkeys(flat, NoiseModel(0.0)), "valve"
    )
    true = run(TRUE, prepare(blank, SHORT, None))
    push = SHORT.piston_areas[0] * true[:, at.P1] - SHORT.piston_areas[1] * true[:, at.P2]
    pressed = np.where(true[:, at.X] >= STROKE, np.maximum(push, 0.0), np.where(true[:, at.X] <= 0.0, push, 0.0))
    x = true[:, at.X] + pressed / stiffness
    at_end = (x <= 0.0) | (x >= STROKE)
    for first in np.flatnonzero(at_end[1:] & ~at_end[:-1]) + 1:
        x[first : first + 13] += np.sign(x[first] - 0.02) * rebound * np.sin(np.linspace(0.0, np.pi, 13))
    seen = {"p1": true[:, at.P1], "p2": true[:, at.P2], "x": x}
    noise = NOISE if np.isinf(stiffness) else NOISE | {"x": NoiseModel(1e-7)}
    read = {name: values + noise[name].draw(time, rng) for name, values in seen.items()}
    return prepare(replace(blank, signals={"u": levels} | read, noise=noise), replace(rig, supply_pressure=7e5), 0.25)


@pytest.fixture(scope="module")
def resting() -> Experiment:
    return with_end_stops([to_and_fro()], SHORT)[0]


def test_most_of_this_recording_is_at_the_ends(resting: Experiment):
    assert np.mean(~resting.is_free) > 0.6


def test_friction_is_what_motion_shows_and_not_what_an_end_carries(resting: Experiment):
    """The pressures push with up to 400 N at the ends; Coulomb friction is 14 N. 15 %: there is little motion."""
    found = fit_model(guess_base_model([resting], SHORT), residual_models([resting]), []).model
    assert found.values["friction.coulomb"] == pytest.approx(FRICTION["friction.coulomb"], rel=0.15)
    assert found.values["friction.viscous"] == pytest.approx(FRICTION["friction.viscous"], rel=0.15)


def test_an_end_that_gives_way_is_an_end():
    """Pressed in by 40 um, seen to 0.1 um: the piston rests deeper the harder it is pressed."""
    (soft,) = with_end_stops([to_and_fro(stiffness=1e7)], SHORT)
    found = fit_model(guess_base_model([soft], SHORT), residual_models([soft]), []).model
    assert np.ptp(soft.inputs[soft.contact_side > 0.0, at.IN_X]) > 10 * 1e-7 * 6
    assert found.values["friction.coulomb"] == pytest.approx(FRICTION["friction.coulomb"], rel=0.15)


def test_a_recording_at_an_end_that_gives_way_is_at_the_end():
    """Its own range of x is only what the end yields: if friction carried 400 N there, it would hold the piston
    everywhere.
    """
    whole = to_and_fro(stiffness=1e7)
    part = slice(2550, 3000)
    signals = {name: values[part] for name, values in whole.recording.signals.items()}
    filling = prepare(replace(whole.recording, time=whole.time[part], signals=signals), whole.rig, 0.25)
    assert np.ptp(filling.inputs[:, at.IN_X]) > 2e-5
    assert (with_end_stops([whole, filling], SHORT)[1].contact_side == 1.0).all()


def test_a_rebound_is_no_end():
    """Deep in an end the piston turns within a sample: it rests elsewhere, and no friction balances its inertia."""
    (thrown,) = with_end_stops([to_and_fro(rebound=4e-4)], SHORT)
    assert np.max(thrown.inputs[:, at.IN_X]) > STROKE + 3e-4
    assert thrown.detected_ends == pytest.approx((0.0, STROKE), abs=5e-5)


def test_the_true_model_waits_at_its_ends_as_the_piston_does(resting: Experiment):
    """Both touch the same end, whose hardness no model states: nothing is compared there, and x is near its noise."""
    seen = compare(TRUE, resting)
    waiting = np.convolve(resting.is_free, np.ones(101), mode="same") == 0.0
    assert np.mean(waiting) > 0.3
    assert np.isnan(seen.residual("x")[waiting]).all()
    assert np.nanstd(seen.residual("x")[500:]) < 5.0 * NOISE["x"].rms


@pytest.mark.parametrize(("stated", "found"), [(STROKE, STROKE), (1.03 * STROKE, STROKE), (None, STROKE)])
def test_ends_are_found_where_the_stroke_is_not_given_or_not_exact(stated: float | None, found: float):
    rig = replace(SHORT, stroke=stated)
    assert with_end_stops([to_and_fro(rig)], rig)[0].stroke_limits == pytest.approx((0.0, found), abs=1e-4)


def test_a_piston_that_friction_holds_in_the_middle_shows_no_end():
    """Steps too short to cross: rests are where friction held it, and the stated ends stand."""
    rig = replace(SHORT, stroke=0.2)
    still = to_and_fro(rig, dwell=0.05)
    assert with_end_stops([still], rig)[0].stroke_limits == pytest.approx((0.0, 0.2))


def test_nothing_counts_on_an_end_not_even_a_force_that_leaves_it(resting: Experiment):
    """With friction taken away the piston would have left its end, but for a spring that nobody told of."""
    (forces,) = [view for view in residual_models([resting]) if "force" in view.channels]
    slippery = Model(SHORT, (), {"friction.coulomb": 0.0, "friction.viscous": 45.0}, FIRST, SECOND)
    left = forces.residual(slippery)["force"]
    assert not left[~resting.is_free].any()
    assert np.max(np.abs(left[resting.is_free])) > 5.0


def test_no_missing_force_acts_on_a_piston_at_its_end(resting: Experiment):
    terms = [t for v in residual_models([resting]) if "force" in v.channels for t in v.discrepancy_terms(TRUE, "force")]
    assert [t.name for t in terms] == ["force", "dry friction", "viscous friction"]
    assert all(t.unit_signal.any() and not t.unit_signal[~resting.is_free].any() for t in terms)


def test_no_imposed_motion_determines_the_force_on_an_end(resting: Experiment):
    assert not resting.force_is_determined[~resting.is_free].any()
    assert resting.force_is_determined[resting.is_free].any()


def pressed(e: Experiment) -> tuple[Experiment, Experiment]:
    """The same motion twice, the second time with 400 N more on the ends, which give way and move the piston."""
    ready = replace(e, detected_ends=(0.0, STROKE), end_compliance=5e-4)
    assert np.any(ready.inputs[~ready.is_free, at.IN_V])
    inputs = ready.inputs.copy()
    inputs[~ready.is_free, at.IN_FORCE] += 400.0
    return ready, replace(ready, inputs=inputs, raw={**ready.raw, "force": inputs[:, at.IN_FORCE]})


def test_p2_is_inferred_from_motion_off_the_ends():
    """What presses the piston into an end would pass for a pressure."""
    soft = to_and_fro(stiffness=1e6)
    signals = {name: values for name, values in soft.recording.signals.items() if name != "p2"}
    ready, pushed = pressed(prepare(replace(soft.recording, signals=signals), soft.rig, 0.25))
    p2, p2_pushed = (with_estimated_pressures(TRUE, ready, e.inputs)[:, at.IN_P2] for e in (ready, pushed))
    assert p2_pushed == pytest.approx(p2)


def test_starts_and_scales_follow_from_motion_off_the_ends():
    ready, pushed = pressed(to_and_fro(stiffness=1e6))
    assert guess_friction([pushed], SHORT) == pytest.approx(guess_friction([ready], SHORT))
    a, b = force_samples([ready], 2.2), force_samples([pushed], 2.2)
    assert np.array_equal(a.friction, b.friction)
    assert pushed.signal_ranges.force < 1.0
    assert ready.signal_ranges.low > 0.0  # of the free motion, though the end gives way
    assert ready.signal_ranges.high < STROKE


# --- rests on a stop tell nothing: without them every answer about the piston is the same


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
