"""What a smooth function of one signal would explain: found over its signal, and not as good as an effect's own law."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from pneucli.diagnose import smooth
from pneucli.diagnose.likelihood import deviance
from pneucli.diagnose.smooth import Left, Smooth, strongest
from pneucli.identify.fit import Fit
from pneucli.identify.parameters import Free
from pneucli.identify.views import Chambers, Forces, View
from pneucli.physics.effects import catalogue
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.run import run
from tests.simulate.benches import RIG, bench, model

N = 8000
TIME = 1e-3 * np.arange(N)
NOISE_OF_TWO = 2.04 * N  # what noise costs in two recordings
MODEL = model()
FORCE, LEAK = catalogue()["constant-force"], catalogue()["chamber-leak"]
RNG = np.random.default_rng


def wandering(seed: int) -> np.ndarray:
    """A signal (n,) of many frequencies below 3 Hz, of rms 1: no function of another one."""
    rng = RNG(seed)
    waves = [np.sin(2 * np.pi * f * TIME + rng.uniform(0, 6)) for f in rng.uniform(0.3, 3.0, 8)]
    return np.asarray(np.sum(waves, axis=0) / 2.0)


def axis(seed: int = 1, kind: type[View] = Forces, begins: float = 0.0, **recorded: Any) -> Any:
    """A view of an axis whose signals wander, each by itself; noise of a channel is 1 N or 1000 Pa."""
    x = 0.1 + 0.02 * wandering(seed)
    signals = {"x": x, "v": np.gradient(x, TIME), "u": wandering(seed + 10)}
    signals |= {"p1": 3e5 + 3e4 * wandering(seed + 20), "p2": 3e5 + 3e4 * wandering(seed + 30), **recorded}
    view = kind(bench("axis", TIME + begins, signals))
    view.__dict__["channels"] = ("force",) if kind is Forces else ("p1", "p2")
    view.__dict__["noise"] = {"force": 1.0} if kind is Forces else {"p1": 1000.0, "p2": 1000.0}
    return view


def left_over(views: list[Any], hidden: list[np.ndarray], jacobian: np.ndarray | None = None, fitted: int = 0) -> Left:
    """What is hidden in each view, in units of noise, and white noise."""
    residual = np.concatenate([part + RNG(i).standard_normal(part.size) for i, part in enumerate(hidden)])
    errors: list[dict[str, Any]] = [{} for _ in views]
    slopes = np.zeros((residual.size, 0)) if jacobian is None else jacobian
    cost = float(deviance(views, residual, errors).sum())
    return Left(views, errors, residual, slopes, fitted or residual.size, cost, MODEL)


def of(view: Any, variable: str) -> np.ndarray:
    return np.asarray(view.experiment.inputs[:, at.INPUTS.index(variable)])


def best(left: Left, effect: Any = FORCE) -> Smooth:
    found = strongest(left, effect)
    assert found is not None
    return found


# --- of the balance of forces


@pytest.mark.parametrize("variable", ["x", "v", "p1", "p2", "u"])
def test_a_hidden_force_is_found_over_its_signal(variable: str) -> None:
    """One that levels off, of 10 times the noise, in two recordings: most of it is explained."""
    views = [axis(1), axis(2)]
    middle, width = of(views[0], variable).mean(), of(views[0], variable).std()
    left = left_over(views, [10.0 * np.tanh((of(view, variable) - middle) / width) for view in views])
    found = best(left)
    assert (found.acts, found.variable) == ("force", variable)
    assert found.gain > 0.7 * (left.cost - NOISE_OF_TWO)


def test_a_friction_that_depends_on_place_is_found_against_the_motion() -> None:
    views = [axis(1), axis(2)]
    left = left_over(views, [10.0 * np.sign(of(v, "v")) * (1.0 + 20.0 * (of(v, "x") - 0.1)) for v in views])
    found = best(left)
    assert (found.acts, found.variable) == ("friction", "x")


def test_a_drift_is_one_over_the_time_of_each_recording() -> None:
    """Time begins with the recording: those that were started 8 s and 16 s later drift alike."""
    views = [axis(1), axis(2, begins=8.0), axis(3, begins=16.0)]
    left = left_over(views, [5.0 * (TIME - 4.0)] * 3)
    found = best(left)
    assert (found.acts, found.variable) == ("force", "time")
    assert found.gain > 0.9 * (left.cost - 1.5 * NOISE_OF_TWO)


def test_recordings_share_one_function() -> None:
    """A force that has the other sign in the other recording is none of its place."""
    views = [axis(1), axis(2)]
    q = [30.0 * (of(v, "x") - 0.1) / 0.02 for v in views]
    same, other = left_over(views, q), left_over(views, [q[0], -q[1]])
    assert best(other).gain < 0.3 * best(same).gain


def test_an_effect_that_is_no_function_of_a_signal_is_not_explained_by_one() -> None:
    """The force of a mass: acceleration is a function of none of the signals. Its own column explains all of it."""
    view = axis(1)
    a = np.gradient(of(view, "v"), TIME)
    column = a / a.std()
    left = left_over([view], [10.0 * column])
    own = left.gain(column[:, None])
    assert own == pytest.approx(left.cost - NOISE_OF_TWO / 2, rel=0.03)
    assert best(left).gain < 0.5 * own


def test_a_signal_that_was_not_recorded_or_never_varies_is_none_to_depend_on() -> None:
    still = np.full(N, 3e5)
    views = [axis(1, p1=still)]
    del views[0].experiment.raw["p2"]
    q = of(views[0], "p2") / 3e4
    over = {variable for _, variable, _ in smooth._functions(views, Forces, MODEL)}
    assert over == {"time", "x", "v", "u"}
    assert best(left_over(views, [10.0 * q])).variable not in ("p1", "p2")


def test_parts_of_a_function_are_in_units_of_the_channels_noise() -> None:
    """Six hats of which one or two are seen at once: together a force of 1 N, and 1 N against the motion."""
    view = axis(1)
    view.__dict__["noise"] = {"force": 4.0}
    nodes = np.linspace(0.05, 0.15, 6)
    force, friction = (smooth._columns(view, Forces, "x", nodes, acts, MODEL) for acts in ("force", "friction"))  # type: ignore[arg-type]
    assert force.shape == (N, 6)
    assert force.sum(axis=1) == pytest.approx(np.full(N, 0.25))
    assert friction == pytest.approx(force * np.sign(of(view, "v"))[:, None])
    assert np.count_nonzero(force, axis=1).max() == 2


def test_each_chamber_has_a_flow_of_its_own() -> None:
    gas, nodes = axis(1, Chambers), np.linspace(0.05, 0.15, 6)
    found = smooth._columns(gas, Chambers, "x", nodes, "flow", MODEL)
    assert found.shape == (2 * N, 12)
    assert not found[:N, 6:].any()
    assert not found[N:, :6].any()
    for rows, channel in ((found[:N, :6], "p1"), (found[N:, 6:], "p2")):
        whole = smooth._filled(gas, np.ones((N, 1)), channel, MODEL)[:, 0]
        assert rows.sum(axis=1) == pytest.approx(whole / 1000.0)


# --- what it is fitted beside, and on what


class Rubbing:
    """A view that leaves what it is said to and what the model's Coulomb friction takes of it."""

    channels = ("force",)
    noise: ClassVar = {"force": 2.0}

    def __init__(self, left: np.ndarray) -> None:
        self.left, self.experiment = left, SimpleNamespace(time=1e-3 * np.arange(left.size))

    def residual(self, model: Any, errors: Any = None) -> dict[str, np.ndarray]:
        return {"force": self.left - model.base()["friction.coulomb"]}

    def carried(self, model: Any) -> dict[str, np.ndarray]:
        return {"force": self.left}

    def volume(self, errors: Any) -> np.ndarray:
        return np.full(self.left.size, 0.01 * errors["force"].mean())

    def tells(self, one: Any, other: Any) -> bool:
        return True


@pytest.mark.parametrize("apart", [True, False])
def test_what_is_left_is_of_fitted_readings_and_of_those_held_out_with_all_slopes(apart: bool) -> None:
    """In units of a noise of 2 N; a step of the friction is 7 N."""
    seen, unseen = Rubbing(20.0 + RNG(1).standard_normal(300)), Rubbing(30.0 + RNG(2).standard_normal(500))
    free = Free("friction.coulomb", "N", 14.0, 0.0, 1e3, 7.0)
    residual, slopes = (seen.left - 14.0) / 2.0, np.full((300, 1), -3.5)
    fit = Fit(model(), (free,), (), residual, slopes, np.zeros(300, int), np.zeros((1, 1)), 0.0, [seen.carried(None)])
    held_out: list[Any] = [unseen] if apart else []
    wanted = np.concatenate([residual, (unseen.left - 14.0) / 2.0]) if apart else residual
    errors = [view.carried(None) for view in (seen, *held_out)]
    told = float(deviance([seen, *held_out], wanted, errors).sum())  # type: ignore[list-item]
    state: Any = SimpleNamespace(fit=fit, deviance=told)
    left = Left.by(state, [seen], held_out)  # type: ignore[list-item]
    assert (left.views, left.fitted) == ([seen, *held_out], 300)
    assert left.residual == pytest.approx(wanted)
    assert left.jacobian == pytest.approx(np.full((wanted.size, 1), -3.5), rel=1e-6)
    assert left.cost == pytest.approx(
        float(deviance([seen, *held_out], wanted, [v.carried(None) for v in left.views]).sum())
    )  # type: ignore[list-item]


def test_what_the_models_own_parameters_can_take_up_is_no_gain_of_a_function() -> None:
    """Only what a function explains beyond them; they explain it as well."""
    view = axis(1)
    q = (of(view, "x") - 0.1) / 0.02
    alone, beside = left_over([view], [10.0 * q]), left_over([view], [10.0 * q], q[:, None])
    column = q[:, None]
    assert beside.gain(column) == pytest.approx(alone.gain(column), rel=1e-6)
    assert beside.gain(np.zeros((N, 1))) == pytest.approx(alone.gain(column), rel=1e-6)


def test_a_function_is_fitted_to_the_fitted_recordings_and_gains_on_all() -> None:
    """On one held out that wants the other sign it costs more than it gains."""
    views = [axis(1), axis(2)]
    q = [10.0 * (of(v, "x") - 0.1) / 0.02 for v in views]
    column = np.concatenate(q)[:, None]
    same, other = left_over(views, q, fitted=N), left_over(views, [q[0], -q[1]], fitted=N)
    assert same.gain(column) == pytest.approx(same.cost - NOISE_OF_TWO, rel=0.03)
    assert other.gain(column) < 0.1 * same.gain(column)


def test_samples_that_do_not_count_are_no_evidence() -> None:
    """A function cannot leave anything where nothing was read."""
    view = axis(1)
    q = 10.0 * (of(view, "x") - 0.1) / 0.02
    left = left_over([view], [q])
    unread = np.arange(N) < N // 2
    residual = np.where(unread, 0.0, left.residual)
    cost = float(deviance([view], residual, [{}]).sum())
    half = Left([view], [{}], residual, np.where(unread, 0.0, wandering(7))[:, None], N, cost, MODEL)
    wild = np.where(unread, 1e6, q)[:, None]
    assert half.gain(wild) == pytest.approx(half.gain(q[:, None]))


def test_what_the_models_parameters_do_where_nothing_was_read_costs_nothing() -> None:
    """The second half, held out, was not read: there the parameter's own 10 would be left of it."""
    view, column = axis(1), wandering(7)[:, None]
    residual = np.where(np.arange(N) < N // 2, 10.0 * column[:, 0] + RNG(1).standard_normal(N), 0.0)
    cost = float(deviance([view], residual, [{}]).sum())
    left = Left([view], [{}], residual, column, N // 2, cost, MODEL)
    assert left.gain(np.zeros((N, 1))) > 0.95 * (cost - NOISE_OF_TWO / 2)


def test_only_views_that_feel_the_effect_are_explained() -> None:
    """A leak shows in the chambers: a force over x is no rival of it, and a flow none of a load."""
    mechanics, gas = axis(1), axis(2, Chambers)
    flow = smooth._filled(gas, np.interp(of(gas, "x"), [0.05, 0.15], [-1.0, 1.0])[:, None], "p1", MODEL)[:, 0]
    left = left_over([mechanics, gas], [10.0 * wandering(5), np.append(20.0 * flow / flow.std(), np.zeros(N))])
    assert best(left, FORCE).acts in ("force", "friction")
    assert (best(left, LEAK).acts, best(left, LEAK).variable) == ("flow", "x")


# --- of the chambers


def closed(x: np.ndarray, **leaks: float) -> tuple[np.ndarray, Any]:
    """Pressures (n, 2) of chambers with the valve shut, where the piston stands at x; leak areas by parameter."""
    time = 1e-3 * np.arange(x.size)
    signals: dict[str, Any] = {"x": x, "v": 0.0, "p1": 5e5, "p2": 5e5}
    e = bench("axis", time, signals, valve_shut=True, restarts=(0, 500))
    e.flags[at.MECHANICS] = 0.0
    return run(model(sorted({k.partition(".")[0] for k in leaks}), leaks), e)[:, [at.P1, at.P2]], e


@pytest.mark.parametrize("place", [0.02, 0.1, 0.18])
def test_a_flow_builds_up_the_pressure_that_simulated_gas_has(place: float) -> None:
    """A choked leak of chamber 1 so small that the flow hardly changes; from the restart on it begins anew."""
    x, area = np.full(1000, place), 2e-10
    with_leak, e = closed(x, **{"chamber-leak.area": area})
    without, _ = closed(x)
    view = Chambers(e)
    flow = 0.484 * area * 5e5 * np.sqrt(2 / (287.0 * 293.15))
    found = smooth._filled(view, np.full((1000, 1), flow), "p1", MODEL)[:, 0] * 1.4 * 287.0 * 293.15
    wanted = (without - with_leak)[:, 0]
    assert wanted[499] > 50.0
    assert found[[499, 999]] == pytest.approx(wanted[[499, 999]], rel=0.03)
    assert found[[0, 500]] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_flow_out_of_a_vessel_builds_up_over_its_volume() -> None:
    rig, area = Rig(ambient_pressure=101_300.0, supply_pressure=7e5), 1e-9
    pressures = []
    for leak in (0.0, area):
        vessel = model(["chamber-leak"], {"chamber-leak.area": leak, "rig.vessel_volume": 1e-3}, rig=rig)
        e = bench("valve", 1e-3 * np.arange(1000), {"u": 0.0, "p1": 5e5}, rig=rig, valve_shut=True)
        pressures.append(run(vessel, e)[:, at.P1])
    flow = np.full((1000, 1), 0.484 * area * 5e5 * np.sqrt(2 / (287.0 * 293.15)))
    found = smooth._filled(Chambers(e), flow, "p1", vessel)[:, 0]
    lost = pressures[0] - pressures[1]
    assert lost[-1] > 50.0
    assert found[[300, 999]] * 1.4 * 287.0 * 293.15 == pytest.approx(lost[[300, 999]], rel=0.02)


def test_both_chambers_of_an_axis_are_filled_over_their_own_volumes() -> None:
    """The same flow: 1 / (dead volume + area times way) of each, the ways being from either end."""
    view = axis(1, Chambers, x=np.full(N, 0.05))
    flow = np.ones((N, 1))
    one, two = (smooth._filled(view, flow, c, MODEL)[-1, 0] for c in ("p1", "p2"))
    volume_1 = RIG.dead_volume_1 + RIG.piston_area_1 * 0.05
    volume_2 = RIG.dead_volume_2 + RIG.piston_area_2 * (RIG.stroke - 0.05)
    assert (one, two) == (pytest.approx(TIME[-1] / volume_1), pytest.approx(TIME[-1] / volume_2))
