"""Each arrangement of the valves is identified from its own recordings: paths of both chambers, the null command."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.guesses.null_command import drifting_recordings, with_identified_null
from pneucli.identify.residuals import residual_models
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.end_stops import with_end_stops
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import run
from pneucli.simulate.valve_forms import SwitchingValve, ValveArea
from tests.simulate.synthetic_experiments import FRICTION, RIG

FIRST = ValveArea((-4.0, -2.0, 2.0, 4.0), (8e-7, 4e-7, 4e-7, 8e-7))
SECOND = ValveArea((-4.0, -2.0, 2.0, 4.0), (6e-7, 3e-7, 3e-7, 6e-7), label="valve_2")
NOISE = {"p1": NoiseModel(300.0), "p2": NoiseModel(300.0), "x": NoiseModel(1e-5)}
LEVELS = (3.0, -2.5, 4.0, -4.0, 2.0, -2.0, 2.5, -3.0)


def axis(rig: Rig, model: Model, u: np.ndarray, u2: np.ndarray | None = None, seed: int = 1) -> Experiment:
    """A recording of both chambers behind valves, from rest in the middle at 3 bar, read with noise."""
    time, rng = 1e-3 * np.arange(u.size), np.random.default_rng(seed)
    held = {"u": u} | ({} if u2 is None else {"u2": u2})
    start = {"p1": 3e5, "p2": 3e5, "x": 0.5 * (rig.stroke or 0.0), "v": 0.0, "p_supply": rig.supply_pressure}
    flat = {name: np.full(time.size, value) for name, value in start.items()}
    blank = Recording("axis", "axis", "train", time, held | flat, dict.fromkeys(flat, NoiseModel(0.0)), "valve")
    true = run(model, prepare(blank, rig, None))
    seen = {"p1": true[:, at.P1], "p2": true[:, at.P2], "x": true[:, at.X]}
    read = {name: values + NOISE[name].draw(time, rng) for name, values in seen.items()}
    return prepare(replace(blank, signals=held | read, noise=NOISE), replace(rig, supply_pressure=7e5), 0.25)


def stairs(levels: tuple[float, ...] = LEVELS) -> np.ndarray:
    return np.repeat(levels, round(0.25 / 1e-3))


def fit(experiments: list[Experiment], form: str = "map") -> Fit:
    rig = experiments[0].rig
    ready = with_end_stops(experiments, rig)
    return fit_model(guess_base_model(ready, rig, form), residual_models(ready), [])


def fitted(experiments: list[Experiment], form: str = "map") -> Model:
    return fit(experiments, form).model


def at_command(model: Model, u: float, chamber: int) -> float:
    return float((model.chamber_2_valve if chamber == 2 else model.valve)(np.array([u]))[0])


def test_a_5_3_valve_has_paths_of_its_own_for_either_chamber():
    """Mirrored by one spool: u fills chamber 1 and vents chamber 2. 3 %: 2 s of data with 3 mbar of noise."""
    rig = replace(RIG, valve_arrangement="5/3")
    true = Model(rig, (), FRICTION, FIRST, SECOND)
    found = fitted([axis(rig, true, stairs()), axis(rig, true, stairs(LEVELS[::-1]), seed=2)])
    for u in (2.0, 4.0, -2.0, -4.0):
        assert at_command(found, u, 1) == pytest.approx(at_command(true, u, 1), rel=0.03)
        assert at_command(found, u, 2) == pytest.approx(at_command(true, u, 2), rel=0.03)


def test_two_valves_follow_commands_of_their_own():
    rig = replace(RIG, valve_arrangement="two")
    true = Model(rig, (), FRICTION, FIRST, SECOND)
    second = stairs((-2.0, 2.5, -4.0, 4.0, -2.5, 2.0, -3.0, 3.0))
    found = fitted([axis(rig, true, stairs(), second)])
    for u in (2.0, 4.0, -2.0, -4.0):
        assert at_command(found, u, 1) == pytest.approx(at_command(true, u, 1), rel=0.03)
        assert at_command(found, u, 2) == pytest.approx(at_command(true, u, 2), rel=0.03)


@pytest.mark.parametrize("null", [5.0, -0.7])
def test_the_null_command_lies_between_what_vents_and_what_fills(null: float):
    """Of a valve of 0 to 10 V that rests near 5 V, driven by a sine: within 50 mV of the truth."""
    rig = replace(RIG, valve_arrangement="5/3", valve_null=null)
    true = Model(rig, (), FRICTION, FIRST, SECOND)
    driven = axis(rig, true, null + 3.0 * np.sin(2 * np.pi * 0.5 * 1e-3 * np.arange(4000)))
    found = with_identified_null([driven.recording], replace(rig, valve_null=0.0, null_free=True))
    assert found.valve_null == pytest.approx(null, abs=0.05)
    low, high = found.null_range
    assert low <= null <= high


@pytest.mark.parametrize(("moved", "seen"), [(0.0, None), (1.2, ("before", "after"))])
def test_recordings_without_a_null_command_in_common_are_named(moved: float, seen: tuple[str, str] | None):
    rig = replace(RIG, valve_arrangement="5/3")
    swing = 3.0 * np.sin(2 * np.pi * 0.5 * 1e-3 * np.arange(4000))
    takes = {}
    for name, null in (("before", 5.0), ("after", 5.0 + moved)):
        at_null = replace(rig, valve_null=null)
        driven = axis(at_null, Model(at_null, (), FRICTION, FIRST, SECOND), null + swing)
        takes[name] = replace(driven.recording, name=name)
    assert drifting_recordings(with_identified_null(list(takes.values()), replace(rig, null_free=True))) == seen
    assert drifting_recordings(replace(rig, valve_null=5.0)) is None


@pytest.mark.parametrize("area", [2e-8, 0.0])
def test_a_leak_does_not_move_the_null_to_where_the_valve_feeds_it(area: float):
    """A valve that is shut within 0.3 V, and a leak of 2.5 % of its area: the flow alone changes sign beside it."""
    rig = replace(RIG, valve_arrangement="5/3", valve_null=0.0)
    edges = {"overlap_fill": 0.3, "overlap_vent": 0.3}
    true = Model(
        rig, (catalogue()["chamber-leak"],), FRICTION | {"chamber-leak.area": area}, replace(FIRST, **edges), SECOND
    )
    time = 1e-3 * np.arange(20_000)
    driven = axis(rig, true, np.sin(2 * np.pi * 0.2 * time) + np.sin(2 * np.pi * 1.3 * time))
    found = with_identified_null([driven.recording], replace(rig, null_free=True))
    print(found.valve_null, found.null_range)
    low, high = found.null_range
    assert found.valve_null == pytest.approx(0.0, abs=0.05)
    assert -0.5 < low < -0.2 < 0.2 < high < 0.5


def test_a_gap_between_commands_is_the_range_of_the_null():
    rig = replace(RIG, valve_arrangement="5/3", valve_null=5.0)
    true = Model(rig, (), FRICTION, FIRST, SECOND)
    stepped = axis(rig, true, 5.0 + stairs())
    low, high = with_identified_null([stepped.recording], replace(rig, valve_null=0.0, null_free=True)).null_range
    assert (low, high) == (pytest.approx(3.0, abs=0.1), pytest.approx(7.0, abs=0.1))


def test_an_unobservable_null_is_refused():
    rig = replace(RIG, valve_arrangement="5/3")
    filling = axis(rig, Model(rig, (), FRICTION, FIRST, SECOND), np.full(1000, 3.0))
    with pytest.raises(InputError, match="never both filled and vented"):
        with_identified_null([filling.recording], replace(rig, null_free=True))


def test_a_switching_valve_is_one_area_each_way():
    rig = replace(RIG, valve_arrangement="5/3", valve_kind="switching")
    one, two = SwitchingValve(8e-7, 6e-7, 10.0), SwitchingValve(5e-7, 7e-7, 10.0, "valve_2")
    true = Model(rig, (), FRICTION, one, two)
    found = fitted([axis(rig, true, np.sign(stairs()) * 1.0)], "switching")
    for valve, wanted in ((found.valve, one), (found.valve_2, two)):
        assert valve.fill == pytest.approx(wanted.fill, rel=0.03)
        assert valve.vent == pytest.approx(wanted.vent, rel=0.03)
