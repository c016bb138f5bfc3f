"""Margins: textbook loops, the linearised loop against the simulated one, and what small signals do not tell."""

import math
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.closed_loop import margins, robustness, simulation
from pneucli.closed_loop.margins import (
    DiscreteSystem,
    LinearisedLoop,
    analyse_margins,
    closed_loop_matrix,
    closed_loop_poles,
    cut_loops,
    impulse_response,
    linearise,
    realise_impulse_response,
    return_ratio,
    stability_margins,
    without_nonsmooth_effects,
)
from pneucli.closed_loop.metrics import evaluate_run
from pneucli.closed_loop.robustness import AxisDistribution, MonteCarloStudy, run_study, success_rates
from pneucli.closed_loop.simulation import simulate
from pneucli.controller import layout
from pneucli.design.cascade_design import choose_bandwidths, design_cascade
from pneucli.errors import InputError
from pneucli.executors import ThreadEngine, engine_from
from pneucli.physics.effects import catalogue
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities
from tests.design import axis

W = np.geomspace(1e-2, 1e3, 4000)
MODEL, CONTROLLER = axis.model(), axis.controller()
CORNER = choose_bandwidths(MODEL, axis.REQUIREMENTS, CONTROLLER.values).position


def test_margins_of_a_textbook_loop() -> None:
    """2 / (s (s + 1) (s + 2)): gain 3 at sqrt(2) rad/s; a delay that is its delay margin leaves no phase."""
    s = 1j * W
    found = stability_margins(W, 2.0 / (s * (s + 1.0) * (s + 2.0)))
    assert found.gain_up == pytest.approx(3.0, rel=1e-3)
    assert found.gain_down == 0.0
    assert found.crossover == pytest.approx(0.749, rel=1e-2)
    assert math.degrees(found.phase) == pytest.approx(32.6, abs=0.2)
    late = stability_margins(W, 2.0 / (s * (s + 1.0) * (s + 2.0)) * np.exp(-s * found.delay))
    assert late.phase == pytest.approx(0.0, abs=1e-3)
    assert late.modulus == pytest.approx(0.0, abs=5e-3)


def test_a_loop_about_an_axis_that_falls_over_needs_its_gain() -> None:
    """4 / (s - 1) is closed to s + 3: a quarter of the gain is the least, any more will do."""
    found = stability_margins(W, 4.0 / (1j * W - 1.0))
    assert found.gain_down == pytest.approx(0.25, rel=1e-3)
    assert found.gain_up == math.inf


def test_one_loop_of_two_is_cut_with_the_other_closed() -> None:
    """Of loops that act on each other, by the states: u1 -> y1 with y2 fed back."""
    loops = np.array([[[2.0, 1.0], [3.0, 4.0]]], dtype=complex)
    assert return_ratio(loops, 0)[0] == pytest.approx(2.0 - 1.0 * 3.0 / (1.0 + 4.0))


def test_a_realisation_gives_the_answer_back_in_as_many_states() -> None:
    rng = np.random.default_rng(0)
    A = np.diag([0.9, 0.5, 1.02])
    markov = impulse_response(A, rng.standard_normal((3, 2)), rng.standard_normal((2, 3)), 40)
    found, missed = realise_impulse_response(markov)
    assert np.sort(np.linalg.eigvals(found.A).real) == pytest.approx([0.5, 0.9, 1.02], abs=1e-9)
    assert missed < 1e-9


def with_effect(name: str, delay: float = 0.0):
    """The axis with one more effect at its smallest typical size, known to the controller, and a delay."""
    effect, facts = catalogue()[name], rig_quantities(MODEL)
    sizes = {f"{name}.{p.name}": p.range_on(facts).typical[0] for p in effect.main_parameters}
    model = replace(MODEL, effects=(*MODEL.effects, effect)).with_values(sizes)
    wanted = replace(axis.REQUIREMENTS, delay=delay)
    controller = design_cascade(model, wanted, axis.SEALED)
    corner = choose_bandwidths(model, wanted, controller.values).position
    bench = replace(axis.BENCH, delay=round(delay / 1e-3), noise_p=0.0, quantum_x=0.0)
    return model, controller, bench, corner


def shaken(monkeypatch: pytest.MonkeyPatch, model, controller, bench, corner, one: LinearisedLoop):
    """The simulated loop's answer in x to an impulse on the position's reading, per m."""
    size, before = 1e-9, math.ceil(margins.SETTLING_TIME_CONSTANTS / corner / controller.period)
    ramp = margins._ramp(controller, one.x, one.speed, before, 100)
    plain = simulate(model, controller, ramp, bench)
    rows = simulation.initial_log

    def pushed(*of):
        found = rows(*of)
        found[before, layout.L_NOISE_X] = size
        return found

    monkeypatch.setattr(simulation, "initial_log", pushed)
    moved = simulate(model, controller, ramp, bench)
    monkeypatch.undo()
    return (moved.model[before + 1 :, at.X] - plain.model[before + 1 :, at.X]) / size


@pytest.mark.parametrize(
    ("name", "delay"), [("heat-transfer", 0.0), ("valve-lag", 0.0), ("line-delay", 2e-3), ("pressure-lag", 0.0)]
)
def test_the_linear_loop_answers_as_the_simulated_one_does(
    monkeypatch: pytest.MonkeyPatch, name: str, delay: float
) -> None:
    model, controller, bench, corner = with_effect(name, delay)
    one = linearise(model, controller, bench, corner, 0.1, 1.0)
    assert one is not None
    whole = closed_loop_matrix(one)
    enters = np.vstack([one.axis.B @ one.controller.D[:, :1], one.controller.B[:, :1]])
    seen = np.hstack([one.axis.C[:1], np.zeros((1, len(one.controller.A)))])
    told = impulse_response(whole, enters, seen, 100)[:, 0, 0]
    came = shaken(monkeypatch, model, controller, bench, corner, one)
    assert np.max(np.abs(told - came)) < 0.15 * np.max(np.abs(came))


def test_a_gain_at_its_margin_puts_a_pole_on_the_imaginary_axis() -> None:
    one = linearise(MODEL, CONTROLLER, axis.BENCH, CORNER, 0.1, 1.0)
    assert one is not None
    margins = cut_loops(one, 0.05 * CORNER)[0].margins
    assert np.max(closed_loop_poles(one).real) < 0.05 * CORNER

    def fastest(gain: float) -> float:
        law = DiscreteSystem(one.controller.A, one.controller.B, gain * one.controller.C, gain * one.controller.D)
        poles = closed_loop_poles(replace(one, controller=law))
        return float(np.max(poles[np.abs(poles) > CORNER].real))

    assert margins.gain_up > 1.2
    assert fastest(0.97 * margins.gain_up) < 0.0 < fastest(1.03 * margins.gain_up)


def test_a_delay_takes_its_time_off_the_margin() -> None:
    wanted = replace(axis.REQUIREMENTS, pressure_bandwidth=20.0)
    controller = design_cascade(MODEL, wanted, axis.SEALED)
    corner = choose_bandwidths(MODEL, wanted, controller.values).position
    found = [
        cut_loops(linearise(MODEL, controller, replace(axis.BENCH, delay=n), corner, 0.1, 1.0), 0.05 * corner)[0]
        for n in (0, 2)
    ]
    assert found[0].margins.delay - found[1].margins.delay == pytest.approx(2e-3, rel=0.1)


def test_a_play_and_two_branches_of_friction_are_left_out_and_named() -> None:
    model = replace(MODEL, effects=(*MODEL.effects, *(catalogue()[n] for n in ("valve-hysteresis", "valve-lag"))))
    model = replace(model, effects=(*model.effects, catalogue()["friction-hysteresis"])).with_values(
        {"valve-hysteresis.half_width": 0.1, "valve-lag.time_constant": 5e-3, "friction-hysteresis.drop": 0.2}
    )
    kept, left = without_nonsmooth_effects(model)
    assert [e.name for e in kept.effects] == ["stribeck", "valve-lag"]
    assert len(left) == 2


@pytest.mark.parametrize("arrangement", axis.ARRANGEMENTS)
def test_every_arrangement_is_looked_at_all_over_the_stroke_and_both_ways(arrangement: str) -> None:
    model, wanted = axis.arranged(arrangement)
    controller = design_cascade(model, wanted, axis.SEALED)
    found = analyse_margins(model, controller, axis.BENCH, choose_bandwidths(model, wanted, controller.values).position)
    assert len(found.poles) + len(found.sticking_points) == 6
    assert not any(found.is_unstable(point) for point in found.poles)
    loops = {cut.loop for cut in found.cuts}
    assert loops == {"command", "position"} | ({"command 2"} if arrangement == "two" else set())
    assert all(cut.margins.phase > math.radians(10.0) for cut in found.cuts)


# --- monte Carlo: reproducible, resumable, the same on threads and on a cluster


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
