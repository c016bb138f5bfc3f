"""Monte Carlo: reproducible, resumable, the same on threads and on a cluster."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.closed_loop import robustness
from pneucli.closed_loop.metrics import evaluate_run
from pneucli.closed_loop.robustness import AxisDistribution, MonteCarloStudy, run_study, success_rates
from pneucli.closed_loop.simulation import simulate
from pneucli.errors import InputError
from pneucli.executors.dask_cluster import engine_from
from pneucli.executors.engine import ThreadEngine
from pneucli.physics.effects import catalogue
from pneucli.recording import Rig
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities
from tests.design import axis

MODEL, CONTROLLER = axis.model(), axis.controller()
TIME = 1e-3 * np.arange(3000)
SCENE = axis.scenario(CONTROLLER, np.full(TIME.size, 0.1), -50.0 * (TIME >= 1.0))
EFFECTS = tuple(catalogue()[n] for n in ("constant-force", "valve-lag"))
AXES = AxisDistribution(MODEL, {"friction.coulomb": 0.1}, robustness.TOLERANCES, EFFECTS)


def study(**more: object) -> MonteCarloStudy:
    known = {"runs": 20, "seed": 3, "checks": robustness.DEFAULT_LIMITS} | more
    return MonteCarloStudy(AXES, CONTROLLER, (SCENE,), axis.BENCH, **known)  # type: ignore[arg-type]


def test_a_draw_depends_on_seed_and_number_alone() -> None:
    assert AXES.draw(1, 5)[0].values == AXES.draw(1, 5)[0].values
    assert AXES.draw(1, 5)[0].values != AXES.draw(2, 5)[0].values
    assert AXES.draw(1, 5)[0].values != AXES.draw(1, 8)[0].values


def test_draws_have_the_spread_that_was_asked_for() -> None:
    """1000 draws: the standard deviation is within 10 % (4 standard errors) of what intervals and tolerances say."""
    drawn = [AXES.draw(0, k)[0].base_values() for k in range(1000)]
    assert np.std([d["friction.coulomb"] for d in drawn]) == pytest.approx(0.1, rel=0.1)
    assert np.std([d["rig.moving_mass"] for d in drawn]) == pytest.approx(0.02 * axis.TRUTH["mass"], rel=0.1)


def test_every_effect_takes_its_turn_at_a_plausible_size() -> None:
    names = [AXES.draw(0, k)[1] for k in range(6)]
    assert names == ["", "constant-force", "valve-lag"] * 2
    for k in range(200):
        for name, size in AXES.draw(0, k)[2].items():
            effect, parameter = name.split(".")
            declared = next(p for p in catalogue()[effect].parameters if p.name == parameter)
            bounds = declared.range_on(rig_quantities(AXES.model))
            assert bounds.lower <= size <= bounds.upper


def test_threads_give_the_same_rows_as_one_after_the_other(tmp_path: Path) -> None:
    assert run_study(study(), ThreadEngine(2), tmp_path / "two") == run_study(
        study(), ThreadEngine(1), tmp_path / "one"
    )


class Counting(ThreadEngine):
    """Counts what it is given; breaks down at the chunk that it is told to."""

    def __init__(self, breaks_at: int | None = None) -> None:
        super().__init__(1)
        self.given, self.breaks_at = 0, breaks_at

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        self.given += 1
        if arguments[0] == self.breaks_at:
            return super().submit(lambda: 1 / 0)
        return super().submit(work, *arguments)


def test_an_interrupted_study_goes_on_where_it_was(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):
        run_study(study(), Counting(breaks_at=16), tmp_path)
    rest = Counting()
    rows = run_study(study(), rest, tmp_path)
    assert rest.given == 1
    assert [r["run"] for r in rows] == list(range(20))


def test_rows_of_another_seed_are_not_taken_for_ones_own(tmp_path: Path) -> None:
    first, second = Counting(), Counting()
    one = run_study(study(runs=3), first, tmp_path)
    other = run_study(study(runs=3, seed=4), second, tmp_path)
    assert second.given == 1
    assert one != other


def test_on_a_dask_cluster_the_rows_are_the_same(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    few = study(runs=4)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0", protocol="tcp"
    ) as cluster:
        address = cluster.scheduler_address.replace("tcp://", "dask://")
        with engine_from(address) as engine:
            there = run_study(few, engine, tmp_path / "dask")
    here = run_study(few, ThreadEngine(2), tmp_path / "threads")
    assert there == here


def test_rates_count_what_held_and_name_the_worst_run() -> None:
    rows = [
        {"run": k, "effect": e, "steady_um": s, "held": {"steady_um": s <= 10.0}}
        for k, (e, s) in enumerate([("", 5.0), ("", 12.0), ("valve-lag", 30.0), ("valve-lag", 3.0)])
    ]
    everything, none, lag = success_rates(rows, {"steady_um": 10.0})
    assert (everything.held, everything.runs, everything.worst_run) == (2, 4, 2)
    assert (none.effect, none.held, none.worst) == ("", 1, 12.0)
    assert (lag.effect, lag.held, lag.runs) == ("valve-lag", 1, 2)


def test_the_controller_holds_on_axes_within_tolerances(tmp_path: Path) -> None:
    plain = AxisDistribution(MODEL, {}, robustness.TOLERANCES, ())
    rows = run_study(
        MonteCarloStudy(plain, CONTROLLER, (SCENE,), axis.BENCH, 24, 0, robustness.DEFAULT_LIMITS),
        ThreadEngine(2),
        tmp_path,
    )
    overall = {r.check: r for r in success_rates(rows, robustness.DEFAULT_LIMITS) if r.effect == "all"}
    assert overall["steady_um"].held >= 20


def test_what_is_stated_of_a_study_goes_over_what_is_usual() -> None:
    found = robustness.read_settings({"kind": "monte-carlo", "runs": 7, "tolerances": {"valve.areas": 0.1}}, "here")
    assert (found.runs, found.seed, found.checks) == (7, 0, robustness.DEFAULT_LIMITS)
    assert found.tolerances == robustness.TOLERANCES | {"valve.areas": 0.1}


def test_an_effect_whose_size_the_rig_does_not_tell_is_refused() -> None:
    with pytest.raises(InputError, match="supply forces"):
        robustness.draw_effect_size(catalogue()["constant-force"], Model(Rig()), np.random.default_rng(0))


def test_the_supply_of_a_drawn_axis_acts_on_its_run() -> None:
    """The scenario states the supply of the design; an axis with another one draws other air."""
    axes = AxisDistribution(MODEL, {}, {"rig.supply_pressure": 0.1}, ())
    drawn = axes.draw(3, 0)[0]
    supply = drawn.base_values()["rig.supply_pressure"]
    assert supply != MODEL.base_values()["rig.supply_pressure"]
    row = robustness.run_draw(replace(study(), distribution=axes), 0)[0]
    scenes = (replace(SCENE, supply=np.full(TIME.size, supply)), SCENE)
    own, other = (evaluate_run(simulate(drawn, CONTROLLER, s, axis.BENCH, seed=3), drawn, CONTROLLER) for s in scenes)
    assert row["air_kg"] == own.air_kg != other.air_kg
