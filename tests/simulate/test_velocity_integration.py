"""A friction bench without a position sensor: motion from an accelerometer between rests (6.6), or from a velocity."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.experiments import EXPERIMENT_KINDS
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.friction.kinematics import estimate_motion
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import ForceBalance, residual_models
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.end_stops import with_end_stops
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import simulate_outputs
from pneucli.simulate.preparation import prepare
from tests.identify_friction.synthetic_recordings import BENCH, NOISE, RIG, pressed, pulses, recorded

STICKY = BENCH._replace(static=18.0, stribeck_velocity=0.015, acceleration_bias=0.3)


@cache
def true_motion() -> dict[str, np.ndarray]:
    return pressed(STICKY, pulses(4, 30.0))


def bench(*signals: str, **constants: float) -> Recording:
    """A recording with p1, p2 and these signals, or what is stated of others."""
    whole = recorded(STICKY, true_motion(), 1)
    rng = np.random.default_rng(9)
    known = {**whole.signals, "v": true_motion()["v"] + 1e-4 * rng.normal(size=whole.time.size)}
    known |= {name: np.full(whole.time.size, value) for name, value in constants.items()}
    noise = {**NOISE, "v": NoiseModel(white=1e-4)}
    chosen = ("p1", "p2", *signals, *constants)
    return replace(
        whole,
        signals={name: known[name] for name in chosen},
        noise={name: noise[name] for name in chosen if name not in constants},
    )


@pytest.mark.parametrize("signals", [("a",), ("v",), ("v", "a")], ids=["a", "v", "v and a"])
def test_motion_follows_without_a_position_sensor(signals: tuple[str, ...]) -> None:
    e = prepare(bench(*signals), RIG, 0.5)
    fastest = np.abs(true_motion()["v"]).max()
    assert np.sqrt(np.mean((e.inputs[:, at.IN_V] - true_motion()["v"]) ** 2)) < 0.02 * fastest
    moved = e.inputs[:, at.IN_X] - e.inputs[0, at.IN_X]
    assert moved == pytest.approx(true_motion()["x"] - true_motion()["x"][0], abs=0.03 * np.ptp(true_motion()["x"]))
    resting = true_motion()["v"] == 0.0
    assert np.mean(e.inputs[resting, at.IN_V] == 0.0) > 0.9
    assert e.motion_is_known
    assert set(e.channels) == {"v", *signals}


def test_the_balance_of_forces_finds_friction_without_a_position_sensor() -> None:
    (e,) = with_end_stops([prepare(bench("a"), RIG, 0.5)], RIG)
    (view,) = residual_models([e])
    assert type(view) is ForceBalance
    found = fit_model(guess_base_model([e], RIG), [view], [catalogue()["stribeck"], catalogue()["acceleration-bias"]])
    assert found["friction.coulomb"].value == pytest.approx(12.0, rel=0.05)
    assert found["friction.viscous"].value == pytest.approx(40.0, rel=0.1)
    assert found["stribeck.static"].value == pytest.approx(18.0, rel=0.05)
    assert found["acceleration-bias.bias"].value == pytest.approx(0.3, abs=0.02)


def test_an_unknown_place_strikes_no_end() -> None:
    """The stated stroke begins at x = 0, where motion is counted from."""
    (e,) = with_end_stops([prepare(bench("a"), RIG, 0.5)], RIG)
    assert e.stroke_limits == (-np.inf, np.inf)
    modelled = simulate_outputs(Model(RIG, (), {"friction.coulomb": 12.0, "friction.viscous": 40.0}), e)["v"]
    assert np.ptp(modelled) > 0.5 * np.ptp(true_motion()["v"])


def test_a_constant_x_is_a_place_where_the_piston_moves() -> None:
    placed, free = prepare(bench("a", x=0.12), RIG, 0.5), prepare(bench("a"), RIG, 0.5)
    assert placed.inputs[0, at.IN_X] == 0.12
    assert placed.inputs[:, at.IN_V] == pytest.approx(free.inputs[:, at.IN_V])
    assert "x" not in placed.channels


def test_a_constant_x_of_a_piston_that_is_held_stays_a_measurement() -> None:
    whole = bench("a", x=0.12)
    quiet = 0.05 * np.random.default_rng(3).normal(size=whole.time.size)
    held = replace(whole, signals={**whole.signals, "a": quiet})
    e = prepare(held, RIG, 0.5)
    assert "x" in e.raw
    assert np.mean(e.inputs[:, at.IN_V] == 0.0) > 0.9


def test_an_acceleration_that_never_rests_is_refused() -> None:
    whole = bench("a")
    wave = 3.0 * np.sin(40.0 * whole.time)
    with pytest.raises(InputError, match="never at rest"):
        prepare(replace(whole, signals={**whole.signals, "a": wave}), RIG, 0.5)


def test_effects_of_the_place_need_a_position() -> None:
    needing = {name for name, e in catalogue().items() if "x" in e.needs}
    assert needing == {"position-friction", "spring-force", "end-cushion"}
    (blind,) = residual_models([prepare(bench("a"), RIG, 0.5)])
    (seeing,) = residual_models([prepare(bench("x", "a"), RIG, 0.5)])
    for name in needing:
        assert not blind.is_sensitive_to(catalogue()[name])
        assert seeing.is_sensitive_to(catalogue()[name])
    with pytest.raises(InputError, match='"spring-force" needs x'):
        fit_model(Model(RIG, (), {}), [blind], [catalogue()["spring-force"]])


def test_a_friction_bench_needs_one_signal_of_motion() -> None:
    kind = EXPERIMENT_KINDS["friction"]
    for name in ("x", "v", "a"):
        assert kind.required_signals({"p1", name}, valve_shut=False) == {"p1"}
    assert kind.required_signals({"p1"}, valve_shut=False) == {"p1", "x"}


@pytest.mark.parametrize("signals", [("v",), ("v", "a")], ids=["v", "v and a"])
def test_friction_identification_takes_a_velocity(signals: tuple[str, ...]) -> None:
    motion = estimate_motion(bench(*signals), Model(RIG))
    error = motion.v - true_motion()["v"]
    assert np.sqrt(np.mean(error**2)) < 0.02 * np.abs(true_motion()["v"]).max()
    placed = estimate_motion(bench(*signals, x=0.1), Model(RIG))
    assert placed.v == pytest.approx(motion.v)
