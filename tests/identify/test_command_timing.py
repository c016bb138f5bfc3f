"""Commands between two samples: held, or changed by a loop that is faster than the logger."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.guesses.null_command import with_common_command_range, with_intersample_commands
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import run
from tests.identify.test_arrangements import FIRST, NOISE, SECOND
from tests.simulate.synthetic_experiments import FRICTION, RIG

SPOOL = replace(RIG, valve_arrangement="5/3", supply_pressure=7e5)
EVERY = 5  # samples of the loop, of which the logger shows one
TIME = 1e-3 * np.arange(8000)


def logged(u: np.ndarray, every: int = EVERY, seed: int = 0) -> Experiment:
    """A 5/3 axis under commands at 1 kHz (V), of which every n-th sample is recorded, with noise."""
    still = {"p1": 3e5, "p2": 3e5, "x": 0.1, "v": 0.0, "p_supply": 7e5}
    fine = Recording("axis", "axis", "train", TIME, {"u": u} | {k: np.full(u.size, s) for k, s in still.items()}, {})
    fine = replace(fine, chamber_2="valve")
    true = run(Model(SPOOL, (), FRICTION, FIRST, SECOND), prepare(fine, SPOOL, None))
    rng, kept = np.random.default_rng(seed), slice(None, None, every)
    seen = {"p1": true[kept, at.P1], "p2": true[kept, at.P2], "x": true[kept, at.X]}
    read = {name: values + NOISE[name].draw(TIME[kept], rng) for name, values in seen.items()}
    signals = {"u": u[kept], "p_supply": np.full(read["x"].size, 7e5)} | read
    return prepare(replace(fine, time=TIME[kept], signals=signals, noise=NOISE), SPOOL, None)


SWING = 3.5 * np.sin(2 * np.pi * 6.0 * TIME) * np.sin(2 * np.pi * 0.8 * TIME + 1.0)
HELD = np.repeat(SWING[::EVERY], EVERY)


def between(e: Experiment) -> np.ndarray:
    (found,) = with_intersample_commands([e], SPOOL)
    return np.asarray(found.inputs[:, at.IN_U])


@pytest.mark.parametrize("seed", range(3))
def test_a_loop_faster_than_the_logger_changed_the_command_between_the_samples(seed: int) -> None:
    seen = logged(SWING, seed=seed)
    assert between(seen)[:-1] == pytest.approx(0.5 * (seen.raw["u"][1:] + seen.raw["u"][:-1]))


@pytest.mark.parametrize("seed", range(3))
def test_a_command_that_was_held_to_the_next_sample_stays(seed: int) -> None:
    seen = logged(HELD, seed=seed)
    assert between(seen) == pytest.approx(seen.raw["u"])


def ringing(late: float) -> np.ndarray:
    """Commands at 1 kHz that jump every 0.35 s, a while (s) after a sample, and ring down."""
    since, number = (TIME - late) % 0.35, np.floor((TIME - late) / 0.35).astype(int)
    return np.array([4.0, -2.5, 6.0, -3.0])[number % 4] * np.exp(-since / 0.2) * np.cos(2 * np.pi * 9.0 * since)


@pytest.mark.parametrize("every", [5, 10])
@pytest.mark.parametrize("late", [0.0, 0.001, 0.003])
def test_intersample_commands_are_identified_where_commands_jump_and_ring(every: int, late: float) -> None:
    """The mean to within a tenth of a jump, root mean square: half of one, were it not told when it jumped."""
    rung, stood = logged(u := ringing(late), every), logged(np.repeat(ringing(late)[::every], every), every)
    true, seen, found = u.reshape(-1, every).mean(axis=1), rung.raw["u"], between(rung)
    jumped = 1 + np.flatnonzero(np.abs(np.diff(seen[1:])) > 1.5)
    assert rms((found - true)[jumped]) < 0.1 * rms(np.diff(seen)[jumped])
    assert found[-1] == seen[-1]
    assert between(stood) == pytest.approx(stood.raw["u"])


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_late_flow_is_no_held_command_and_no_changed_one() -> None:
    """Commands that come ten milliseconds late are a lag's: the recorded ones stay as they are."""
    late = logged(np.append(np.zeros(10), SWING[:-10]))
    lagging = replace(late, inputs=late.inputs.copy(), raw=late.raw | {"u": SWING[::EVERY]})
    lagging.inputs[:, at.IN_U] = SWING[::EVERY]
    assert between(lagging) == pytest.approx(SWING[::EVERY])


def test_a_logger_as_fast_as_a_loop_records_every_command() -> None:
    seen = logged(SWING, every=1)
    assert between(seen) == pytest.approx(seen.raw["u"])


def test_steps_are_held() -> None:
    steps = logged(np.repeat([2.0, -2.0, 1.0, -1.0], 2000))
    assert between(steps) == pytest.approx(steps.raw["u"])


def test_readings_beyond_all_numbers_tell_nothing() -> None:
    seen = logged(SWING)
    endless = replace(seen, inputs=seen.inputs.copy())
    endless.inputs[:, at.IN_SUPPLY] = np.nan
    assert between(endless) == pytest.approx(seen.raw["u"])


def test_a_common_range_of_commands_does_not_change_the_recordings() -> None:
    small, large = logged(0.1 * SWING), logged(SWING)
    shared = with_common_command_range([small, large])
    assert [e.flags[at.U_MAX] for e in shared] == [large.flags[at.U_MAX]] * 2
    assert small.flags[at.U_MAX] < 0.2 * large.flags[at.U_MAX]
    model = Model(SPOOL, (), FRICTION, FIRST, SECOND)
    before, after = run(model, small)[:, at.P1], run(model, shared[0])[:, at.P1]
    assert after == pytest.approx(before, abs=0.1 * NOISE["p1"].rms)
