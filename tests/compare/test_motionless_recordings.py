"""Recordings in which nothing moves, or all but nothing: no stage fails, and none invents a motion."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli.compare import find_error_regions, overall_error
from pneucli.compare.channel_errors import compare, residual_correlations
from pneucli.compare.expected_error import expected_errors
from pneucli.identify.friction.identification import break_away
from pneucli.identify.friction.kinematics import estimate_motion
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import residual_models
from pneucli.noise import estimate_noise
from pneucli.recording import Recording, Rig
from pneucli.simulate.end_stops import with_end_stops
from pneucli.simulate.preparation import prepare

RIG = Rig(
    ambient_pressure=101_300.0,
    supply_pressure=7e5,
    piston_area_1=8e-4,
    piston_area_2=7e-4,
    stroke=0.2,
    dead_volume_1=3e-5,
    dead_volume_2=3e-5,
    moving_mass=2.2,
    valve_arrangement="5/3",
)
TIME = 4e-3 * np.arange(300)
STEP = 1e-5  # m, of the encoder
COURSES = ("nothing", "one sample", "noise", "rests twice")


def recorded(kind: str, place: float, course: str, seed: int, *, accelerometer: bool, charged: bool) -> Recording:
    """A piston at ``place`` (m) while chamber 2 is charged against the stop, or vented."""
    rng = np.random.default_rng(seed)
    x = np.full(TIME.size, place)
    x[150] += STEP * (course == "one sample")
    x[150:] += 0.05 * (course == "rests twice")
    x += STEP * np.round(0.4 * rng.standard_normal(TIME.size)) * (course == "noise")
    charge = 5e5 * charged * (1.0 - np.exp(-TIME / 0.2))
    p1, p2, supply = (200.0 * rng.standard_normal((3, TIME.size)).T + (101_300.0, 101_300.0, 7e5)).T
    signals = {"x": x, "p1": p1, "p2": p2 + charge}
    if kind == "axis":
        signals |= {"u": np.where(TIME > 0.04, -3.0 * charged, 0.0), "p_supply": supply}
    if accelerometer:
        signals["a"] = 0.05 * rng.standard_normal(TIME.size)
    noise = {name: estimate_noise(TIME, y) for name, y in signals.items()}
    return Recording("still", kind, "train", TIME, signals, noise, chamber_2="valve" if kind == "axis" else "closed")


@given(
    kind=st.sampled_from(["axis", "friction"]),
    place=st.sampled_from([0.0, 0.1, 0.15]),
    course=st.sampled_from(COURSES),
    seed=st.integers(0, 99),
    accelerometer=st.booleans(),
    charged=st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_every_stage_holds_where_nothing_moves(
    kind: str, place: float, course: str, seed: int, *, accelerometer: bool, charged: bool
) -> None:
    one = recorded(kind, place, course, seed, accelerometer=accelerometer, charged=charged)
    experiments = with_end_stops([prepare(one, RIG, 0.5)], RIG)
    model = guess_base_model(experiments, RIG)
    for view in residual_models(experiments):
        errors = view.initial_state_sensitivity(model)
        assert all(np.isfinite(r).all() for r in view.residual(model, errors).values())
        assert all(np.isfinite(r) for r in view.monte_carlo_rms(model, errors, 2, 0).values())
    comparisons = [
        compare(model, e, one.rms) for e, one in zip(experiments, expected_errors(model, experiments), strict=True)
    ]
    results = [r for c in comparisons for r in c.results]
    assert all(np.isfinite(r.rmsd) for r in results)
    assert overall_error(results, "test") is None
    find_error_regions(comparisons)
    list(residual_correlations(comparisons[0], 0.5))
    if kind == "friction":
        motion = estimate_motion(one, model)
        assert course != "nothing" or not motion.moving.any()
        break_away(motion)


def test_a_channel_that_the_stop_decides_throughout_has_no_result() -> None:
    """Charged against its stop all the time, which the same rig's recording elsewhere shows to be one."""
    still = recorded("axis", 0.0, "nothing", 0, accelerometer=False, charged=True)
    ready = replace(prepare(still, RIG, 0.5), detected_ends=(0.0, np.inf), stroke_limits=(0.0, 0.2))
    model = guess_base_model([ready], RIG).with_values({"friction.coulomb": 50.0})
    found = compare(model, ready, dict.fromkeys(ready.channels, 1.0))
    assert [r.channel for r in found.results] == ["p1", "p2"]
    assert np.isnan(found.measured["x"]).all()
