"""Friction as a set: exact rest, breaking away, stopping within a step, ends of the stroke, by closed solutions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli.simulate import layout as at
from pneucli.simulate.build import build
from pneucli.simulate.run import run

from .synthetic_experiments import FRICTION, RIG, STRIBECK, make_experiment, model, time_grid

COULOMB = FRICTION["friction.coulomb"]
# no pressure difference to ambient: the force alone drives
LOOSE = {"p1": RIG.ambient_pressure, "p2": RIG.ambient_pressure}
TEN_SECONDS = time_grid(10.0)
DWELL = STRIBECK | {"dwell-breakaway.gain": 0.5, "dwell-breakaway.time_constant": 0.3}


def pushed(force, values=None, time=TEN_SECONDS, restarts=(0,), **signals) -> np.ndarray:
    """The kernel's output where a force (N) drives the piston."""
    values = values or {}
    names = sorted({key.partition(".")[0] for key in values} - {"friction"})
    signals = {**LOOSE, "force": force, **signals}
    return run(model(names, values), make_experiment("friction", time, signals, restarts=restarts))


@pytest.mark.parametrize("direction", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("values", "hold"),
    [({}, COULOMB), (STRIBECK, 22.0), (STRIBECK | {"friction-hysteresis.drop": 0.4}, 22.0), (DWELL, 22.0)],
    ids=["coulomb", "stribeck", "hysteresis", "dwell"],
)
def test_a_load_below_breakaway_is_held_without_any_creep(values: dict[str, float], hold: float, direction) -> None:
    out = pushed(direction * hold * (1 - 1e-9), values)
    assert np.all(out[:, at.X] == 0.1)
    assert np.all(out[:, at.V] == 0.0)
    assert np.all(out[:, at.A] == 0.0)


@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_a_load_above_breakaway_moves_it(direction: float) -> None:
    out = pushed(direction * COULOMB * (1 + 1e-9), time=time_grid(0.1))
    assert direction * out[-1, at.V] > 0.0


@settings(max_examples=25, deadline=None)
@given(rate=st.floats(5.0, 500.0), values=st.sampled_from([{}, STRIBECK]))
def test_a_rising_force_breaks_away_at_the_static_friction(rate: float, values: dict) -> None:
    time = time_grid(6.0)
    out = pushed(rate * time, values, time)
    broken = time[np.flatnonzero(out[:, at.V] != 0.0)[0]]
    due = values.get("stribeck.static", COULOMB) / rate
    assert due - 1e-9 <= broken <= due + 1.3e-3  # a sample and a step of 0.2 ms


@settings(max_examples=25, deadline=None)
@given(v=st.floats(0.01, 0.5), coulomb=st.floats(5.0, 100.0), direction=st.sampled_from([-1.0, 1.0]))
def test_it_stops_after_the_distance_of_a_constant_deceleration_and_sticks(v, coulomb, direction) -> None:
    values = {"friction.coulomb": coulomb, "friction.viscous": 0.0}
    lasting, distance = 2.2 * v / coulomb, 0.5 * 2.2 * v * v / coulomb  # m v / F and m v^2 / (2 F)
    if distance > 0.09:  # reaches a stop
        return
    out = pushed(0.0, values, time_grid(lasting + 0.01), v=direction * v)
    assert out[-1, at.V] == 0.0
    assert out[-1, at.X] - 0.1 == pytest.approx(direction * distance, rel=1e-9)


def test_viscous_friction_alone_slows_exponentially() -> None:
    out = pushed(0.0, {"friction.coulomb": 0.0}, time_grid(0.2), v=0.3)
    exact = 0.3 * np.exp(-FRICTION["friction.viscous"] / RIG.moving_mass * time_grid(0.2))
    assert np.abs(out[:, at.V] - exact).max() < 1e-5


def test_between_the_branches_of_hysteresis_the_velocity_is_constant() -> None:
    values = {"friction-hysteresis.drop": 0.4, "friction.viscous": 0.0}
    out = pushed(0.8 * COULOMB, values, time_grid(0.5), v=0.1)
    assert np.all(out[:, at.V] == 0.1)


def test_static_friction_grows_with_the_time_at_rest() -> None:
    """22 N, and half as much again after a long rest: 30 N hold after three time constants, not at once."""
    time = time_grid(3.0)
    late = pushed(np.where(time < 2.0, 0.0, 30.0), DWELL, time)
    soon = pushed(30.0, DWELL, time)
    assert np.all(late[:, at.V] == 0.0)
    assert soon[10, at.V] > 0.0


def test_a_restart_counts_the_rest_that_was_measured() -> None:
    """A push of 40 N moves the simulated piston; the real one rests for 2.4 s, and 30 N hold it."""
    time = time_grid(3.0)
    force = np.where(time < 2.3, 0.0, np.where(time < 2.35, 40.0, 30.0))
    out = pushed(force, DWELL, time, restarts=(0, 2400))
    assert out[2399, at.V] > 0.0
    assert np.all(out[2400:, at.V] == 0.0)


@pytest.mark.parametrize(("force", "end"), [(200.0, RIG.stroke), (-200.0, 0.0)])
def test_it_stops_at_the_ends_of_the_stroke_and_leaves_when_pulled(force: float, end: float) -> None:
    time = time_grid(2.0)
    out = pushed(np.where(time < 1.0, force, -force), time=time)
    assert out[:, at.X].min() >= 0.0
    assert out[:, at.X].max() <= RIG.stroke
    assert np.all(out[800:1000, at.X] == end)
    assert np.all(out[800:1000, at.V] == 0.0)
    assert out[1100, at.X] != end


def test_time_pressed_against_a_stop_counts_as_rest() -> None:
    """Pulled with 30 N after a second at the stop it holds; without dwell it would leave."""
    time = time_grid(3.0)
    force = np.where(time < 2.0, 200.0, -30.0)
    assert pushed(force, STRIBECK, time)[-1, at.X] < RIG.stroke
    assert pushed(force, DWELL, time)[-1, at.X] == RIG.stroke


BRISTLES = {"presliding.stiffness": 1e5, "presliding.damping": 100.0}


def test_bristles_yield_to_a_load_by_its_force_over_stiffness_and_hold_it() -> None:
    """Loaded slowly, dz = dx (1 - z / z_max), so that x = -z_max ln(1 - F / g) with z_max = g / stiffness."""
    time = time_grid(6.0)
    out = pushed(np.minimum(time / 4.0, 1.0) * 0.5 * COULOMB, BRISTLES, time)
    assert out[4500, at.X] - 0.1 == pytest.approx(-COULOMB / 1e5 * np.log(0.5), rel=5e-3)  # rings a little
    assert abs(out[-1, at.X] - out[4500, at.X]) < 1e-10


@pytest.mark.parametrize("force", [10.0, -10.0])
def test_at_a_restart_bristles_hold_a_resting_piston_where_it_is(force: float) -> None:
    """Unbent ones would yield by 140 um; they would also where the simulated piston came from elsewhere."""
    out = pushed(force, BRISTLES, time_grid(1.0), restarts=(0, 500))
    assert out[:, at.X] == pytest.approx(np.full(1001, 0.1), abs=1e-9)


def test_at_a_restart_in_motion_bristles_are_bent() -> None:
    """At the speed at which 50 N balance friction it stays from the first sample on."""
    v = (50.0 - COULOMB) / FRICTION["friction.viscous"]
    out = pushed(50.0, BRISTLES, time_grid(0.1), v=v)
    assert out[:, at.V] == pytest.approx(np.full(101, v), rel=1e-6)


def test_bristles_slide_with_the_same_friction_as_a_rigid_contact() -> None:
    out = pushed(40.0, BRISTLES, time_grid(0.1))[50:]  # bent after some ms; then z = g / stiffness
    rigid = (40.0 - COULOMB - FRICTION["friction.viscous"] * out[:, at.V]) / RIG.moving_mass
    assert np.abs(out[:, at.A] / rigid - 1).max() < 1e-3


@pytest.mark.parametrize("gap", [0.1, 0.5, 2.0, 10.0])
def test_noise_does_not_favour_a_gap_between_the_branches(gap: float) -> None:
    """Friction of one level, drive and friction read with the same noise: no gap may lower the cost, at any level."""
    soft_clip = build((), compiled=False).functions.mean_clipped_drive
    rng = np.random.default_rng(5)
    drive = rng.normal(size=4000)
    friction = drive + 0.5 * rng.normal(size=drive.size)

    def cost(level: float) -> float:
        branches = np.array([soft_clip(d, level - gap, level, 1.0) for d in drive])
        return float(np.mean((friction - branches[:, 0]) ** 2 + 2.0 * branches[:, 1]))

    best = min(cost(level) for level in np.linspace(0.0, gap, 11))
    assert best > np.mean(friction**2) * (1 - 3 / np.sqrt(drive.size))
