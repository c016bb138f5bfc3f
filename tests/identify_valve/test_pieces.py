"""Coverage, maps, lack of fit and the gradient of a model, each by itself, in round numbers."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.identify.estimation.fit import Estimate
from pneucli.identify.estimation.model_fit import free_parameters
from pneucli.identify.residuals import ChamberPressures
from pneucli.identify.valve import iso6358
from pneucli.identify.valve.identification import LackOfFit, MeasuredGradient, lack_of_fit
from pneucli.identify.valve.iso6358 import iso_conductances
from pneucli.identify.valve.model_gradient import (
    REPEATABILITY,
    Coverage,
    ModelGradient,
    QuasiStaticGradient,
    coverage_of,
    memory_gradient,
    model_gradient_of,
)
from pneucli.physics.effects import catalogue
from pneucli.simulate import layout as at
from pneucli.simulate.model import parameter_value, with_parameters
from pneucli.simulate.run import simulate
from pneucli.simulate.valve_forms import area_parameter_name
from tests.simulate.synthetic_experiments import VALVE, held_commands, make_experiment, model, time_grid

NONE: Any = None


# --- where recordings went


class Overlapped:
    """A valve that is shut up to 0.3 V."""

    def __init__(self, form: str = "map") -> None:
        self.form = form

    def __call__(self, u: np.ndarray) -> np.ndarray:
        return np.maximum(np.abs(u) - 0.3, 0.0)


SHUT: Any = Overlapped()
WENT = Coverage(np.array([-10.0, -4.0, 2.0, 6.0]), np.array([1e5, 1e5, 1e5, 3e5]), np.array([7e5, 4e5, 5e5, 7e5]), SHUT)


@pytest.mark.parametrize(
    ("u", "p", "told"),
    [
        (2.0, 1e5, True), (2.0, 5e5, True), (2.0, 5.1e5, False),  # a command and its ends
        (3.0, 2e5, True), (3.1, 2e5, False), (1.0, 2e5, True), (0.9, 2e5, False),  # a tenth of the largest command
        (4.0, 4e5, True), (4.0, 2e5, False), (4.0, 6e5, False),  # between two that both saw the pressure
        (-7.0, 3e5, True), (-7.0, 5e5, False), (-9.0, 5e5, True), (-3.0, 2e5, True),
        (8.0, 5e5, False), (7.0, 5e5, True),
        (-0.9, 2e5, False), (0.3, 6.5e5, True), (-0.3, 2e5, True), (0.0, 0.9e5, False),  # shut: any command's pressure
        (0.31, 6.5e5, False),
    ],
)  # fmt: skip
def test_recordings_cover_commands_close_to_theirs_and_between_them(u: float, p: float, told: bool) -> None:
    assert bool(WENT(np.array([[u]]), np.array([[p]]))[0, 0]) == told


def went(u: np.ndarray, p: np.ndarray) -> Any:
    """A valve test of these commands and pressures."""
    inputs = np.zeros((u.size, len(at.INPUTS)))
    inputs[:, at.IN_U], inputs[:, at.IN_P1], inputs[:, at.IN_SUPPLY] = u, p, 7e5
    time = 0.1 * np.arange(u.size)
    return SimpleNamespace(inputs=inputs, time=time, vessel=True, recording=SimpleNamespace(period=0.1, chamber=1))


def test_the_coverage_is_of_all_levels_and_the_pressures_that_each_saw() -> None:
    tests = [
        went(np.array([5.0, 5.0, 6.0]), np.array([1e5, 2e5, 3e5])),
        went(np.array([-5.0] * 2), np.array([7e5, 6e5])),
    ]
    found = coverage_of(tests, SHUT)
    assert found.commands.tolist() == [-5.0, 5.0, 6.0]
    assert found.lowest.tolist() == [6e5, 1e5, 3e5]
    assert found.highest.tolist() == [7e5, 2e5, 3e5]


def test_of_very_many_levels_those_within_a_hundredth_of_the_largest_are_one_that_saw_what_each_saw() -> None:
    u = np.linspace(-2.0, 1.0, 800)
    found = coverage_of([went(u, 1e5 + u)], SHUT)
    assert found.commands == pytest.approx(np.linspace(-2.0, 1.0, 151), abs=1e-9)
    for level, lowest, highest in zip(found.commands, found.lowest, found.highest, strict=True):
        alike = 1e5 + u[np.abs(u - level) < 0.01]
        assert (lowest, highest) == (alike.min(), alike.max())


def test_two_hundred_levels_are_taken_as_they_are() -> None:
    u = np.linspace(0.0, 1.0, 200) ** 2
    assert coverage_of([went(u, 1e5 + u)], SHUT).commands.tolist() == u.tolist()


class Straight:
    """dp/dt = 1e5 u + 0.1 p, to 1 % of the pressure."""

    ambient, supply, commands, form = 1e5, 7e5, (-4.0, 4.0), "map"
    command_grid = ModelGradient.command_grid

    @property
    def valve(self) -> Overlapped:
        return Overlapped(self.form)

    def __call__(self, u: np.ndarray, p: np.ndarray, supply: Any = None) -> np.ndarray:
        return np.asarray(1e5 * u + 0.1 * p)

    def fit_error(self, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.asarray(0.01 * p)

    standard_error = fit_error


LAW: Any = Straight()


# --- the model against measured gradients


def lacking(difference: list[float], covered: list[bool], ci: float = 10.0, error: float = 5.0) -> LackOfFit:
    """Gradients of 1000, 1000, 500 and 9 at one command, and a model that is off by ``difference``."""
    gradient = np.array([[1000.0, 1000.0, 500.0, 9.0]])
    of = np.full(gradient.shape, error), gradient, np.full(gradient.shape, ci), np.array([covered])
    return LackOfFit(NONE, NONE, gradient - difference, *of)


ALL = [True] * 4


def test_differences_count_where_data_covered_the_map_and_something_flows() -> None:
    """Below a hundredth of the largest gradient a share says little, and where half the interval is a tenth of it."""
    found = lacking([30.0, -10.0, 50.0, 9.0], ALL)
    assert found.difference.tolist() == [[30.0, -10.0, 50.0, 9.0]]
    assert found.has_flow.tolist() == [[True, True, True, False]]
    assert found.relative_difference[found.has_flow] == pytest.approx([0.03, 0.01, 0.1])
    assert (found.median, found.p95) == (pytest.approx(0.03), pytest.approx(0.093))
    some = lacking([30.0, -10.0, 50.0, 9.0], [True, True, False, True])
    assert some.has_flow.tolist() == [[True, True, False, False]]
    assert some.outside.tolist() == [[True, False, False, False]]
    slow = lacking([30.0, -10.0, 50.0, 9.0], [False, False, True, True], ci=0.8)  # 9 of 500: of what was measured
    assert slow.has_flow.tolist() == [[False, False, True, True]]
    assert lacking([30.0, -10.0, 50.0, 9.0], ALL, ci=60.0).has_flow.tolist() == [[True, True, False, False]]
    none = lacking([30.0, -10.0, 50.0, 9.0], [False] * 4)
    assert (none.median, none.p95, none.share_outside, none.is_significant) == (None, None, None, False)


@pytest.mark.parametrize(
    ("ci", "error", "share"), [(10.0, 5.0, 2 / 3), (29.0, 5.0, 2 / 3), (31.0, 5.0, 1 / 3), (10.0, 16.0, 1 / 3)]
)
def test_outside_is_what_neither_interval_allows_for(ci: float, error: float, share: float) -> None:
    assert lacking([30.0, -9.0, 50.0, 9.0], ALL, ci, error).share_outside == pytest.approx(share)


@pytest.mark.parametrize(
    ("difference", "ci", "error", "noticeable"),
    [
        ([21.0, 0, 0, 0], 2.0, 1.0, True),
        ([19.0, 0, 0, 0], 2.0, 1.0, False),
        ([0, 0, 0, 9.0], 0.1, 0.1, False),
        ([46.0, 0, 0, 0], 30.0, 1.0, True),  # 1.5 times the interval
        ([44.0, 0, 0, 0], 30.0, 1.0, False),
        ([44.0, 0, 0, 0], 2.0, 16.0, False),
    ],
)
def test_a_fiftieth_of_the_gradient_and_three_standard_errors_are_noticeable(
    difference: list[float], ci: float, error: float, noticeable: bool
) -> None:
    assert lacking(difference, ALL, ci, error).is_significant == noticeable


def test_at_more_than_a_twentieth_of_the_points() -> None:
    for off, noticeable in ((5, False), (6, True)):
        modelled = np.where(np.arange(100) < off, 500.0, 1000.0)
        measured, none = np.full(100, 1000.0), np.zeros(100)
        found = LackOfFit(NONE, NONE, modelled, none, measured, none, np.ones(100, dtype=bool))
        assert found.is_significant == noticeable


def test_the_misfit_is_what_noise_does_not_explain() -> None:
    rng = np.random.default_rng(0)
    measured, every = np.full(20_000, 1000.0), np.ones(20_000, dtype=bool)
    for share in (0.0, 0.05):
        model = measured * (1.0 + share * rng.standard_normal(20_000)) + 20.0 * rng.standard_normal(20_000)
        found = LackOfFit(NONE, NONE, model, NONE, measured, np.full(20_000, 20.0 * 1.959964), every)
        assert found.misfit(every, measured) == pytest.approx(share, abs=0.004)
    assert found.misfit(~every, measured) == 0.0


def passed(u: list[float], p: list[float], remaining: list[float], noise: float = 0.0, drift: float = 0.0) -> LackOfFit:
    """The lack of fit of a recording in which this remains of the pressure, a reading every 0.1 s."""
    size = len(u)
    arrays = np.array(remaining), np.full(size, noise), drift * np.arange(size), np.ones(size)
    return lack_of_fit(LAW, [MeasuredGradient(went(np.array(u), np.array(p)), *arrays, NONE)])


def test_a_cell_has_the_slope_of_what_remains_of_the_pressure_while_it_was_visited() -> None:
    """Cells are 0.5 bar high, at commands that were held; what follows a jump of the command has not settled."""
    found = passed([2.0] * 4 + [4.0] * 4, [1.1e5] * 3 + [1.9e5] + [2.1e5] * 4, [0, 10, 20, 99, 99, 99, 100, 102], 3.0)
    assert found.u[:, 0].tolist() == [2.0, 4.0]
    assert found.p[0, :3] == pytest.approx([1.25e5, 1.75e5, 2.25e5])
    assert np.argwhere(found.covered).tolist() == [[0, 0], [1, 2]]  # one reading at 1.9 bar has no slope
    assert found.difference[0, 0] == pytest.approx(20 / 0.2)
    assert found.difference[1, 2] == pytest.approx(3 / 0.2)  # without the first reading
    assert found.half_interval[0, 0] == pytest.approx(2.12 * 3.0 * np.sqrt(2.0) / 0.2, rel=1e-3)  # of 16 draws
    assert found.model[0, 0] == pytest.approx(2e5 + 1.25e4)


def test_visits_that_scatter_more_than_noise_widen_the_interval() -> None:
    rises = [10.0, -10.0, 30.0, 10.0]
    remaining: list[float] = []
    for rise in rises:
        remaining += [0.0, rise, 0.0, 0.0]
    found = passed([2.0] * 16, [1.2e5, 1.2e5, 3.2e5, 3.2e5] * 4, remaining)
    assert found.difference[0, 0] == pytest.approx(np.mean(rises) / 0.1)
    error = np.std(rises, ddof=1) / 0.1 / 2.0
    assert found.half_interval[0, 0] == pytest.approx(3.182 * error, rel=1e-3)


def test_a_pressure_that_is_wrong_throughout_a_visit_widens_the_interval() -> None:
    sure, unsure = (passed([2.0] * 3, [1.2e5] * 3, [0, 1, 2], 3.0, drift).half_interval[0, 0] for drift in (0.0, 40.0))
    assert unsure == pytest.approx(np.hypot(sure, 2.12 * 80.0 / 0.2), rel=1e-3)


# --- the gradient of a model


def quiet(names: list[str], values: dict[str, float], restarts: tuple[int, ...] = (0,)) -> tuple[Any, Any]:
    time = time_grid(1.0)
    u = held_commands(time, [0.0, 6.0, -6.0, 0.0], 0.25)
    test = make_experiment("valve", time, {"u": u, "p1": 3e5}, restarts=restarts)
    known = model(names, values | {"rig.vessel_volume": 2e-4})
    return known, test


def test_the_contribution_of_heat_is_the_simulated_minus_the_quasi_static_gradient() -> None:
    values = {"heat-transfer.conductance": 0.7}
    known, test = quiet(["heat-transfer"], values, (0, 400))
    found, p = memory_gradient(known, test), simulate(known, test)["p1"]
    assert np.abs(found[260:490]).max() > 1e4
    still = QuasiStaticGradient(known, test)
    u = test.inputs[:, 0]
    for k in (300, 398, 600, 999):
        mean = 0.5 * sum(still(u[k : k + 1], p[j : j + 1], np.array([7e5]))[0] for j in (k, k + 1))
        assert found[k] == pytest.approx((p[k + 1] - p[k]) / 1e-3 - mean, rel=1e-6)
    assert found[399] == found[398]  # what a restart mends is no gradient
    assert found[1000] == found[999]


@pytest.mark.parametrize(
    "values", [{"chamber-leak.area": 2e-8}, {"pump-flow.slip": 8e-10, "pump-flow.clearance": 0.1}], ids=["leak", "pump"]
)
def test_the_error_of_the_fit_is_that_of_all_parameters_together(values: dict[str, float]) -> None:
    """Beside a leak or the slip of a pump, whose parameters are no areas, and at commands beyond all knots."""
    known, test = quiet([next(iter(values)).partition(".")[0]], values)
    known = replace(known, valve=replace(known.valve, overlap_fill=0.3))
    free = free_parameters(known, [ChamberPressures(test)])
    rng = np.random.default_rng(0)
    root = 1e-3 * rng.standard_normal((len(free), len(free)))
    one = model_gradient_of(SimpleNamespace(model=known, free=tuple(free), covariance=root @ root.T), [test])  # type: ignore[arg-type]
    u, p, supply = np.linspace(-12.0, 12.0, 40), np.linspace(1.2e5, 6e5, 40), np.full(40, one.supply)
    slopes = []
    for f in free:
        z = f.to_coordinate(parameter_value(known, f.name))
        ends = [with_parameters(known, {f.name: f.from_coordinate(z + step)}) for step in (1e-4, -1e-4)]
        above, below = (QuasiStaticGradient(end, test)(u, p, supply) for end in ends)
        slopes.append((above - below) / 2e-4)
    expected = np.linalg.norm(root.T @ np.array(slopes), axis=0)
    assert one.fit_error(u, p) == pytest.approx(expected, rel=0.01, abs=1e-3 * expected.max())
    assert all(slope.any() for slope in slopes)


def test_a_gradient_is_no_surer_than_its_valve_repeats_or_than_measured_ones_show() -> None:
    known, test = quiet([], {})
    one = model_gradient_of(SimpleNamespace(model=known, free=(), covariance=np.zeros((0, 0))), [test])  # type: ignore[arg-type]
    u, p = np.array([6.0, 0.0]), np.full(2, 3e5)
    relative = np.hypot(REPEATABILITY, known.valve.interpolation_uncertainty)
    assert one.standard_error(u, p) == pytest.approx([relative * one(u, p)[0], 0.0])
    wider = replace(one, relative_misfit=0.05, shut_misfit=2e3)
    assert wider.standard_error(u, p) == pytest.approx([np.hypot(np.hypot(relative, 0.05) * one(u, p)[0], 2e3), 2e3])


# --- ISO characteristics piece by piece: which interval holds, and whose command it is


UNIT = 0.484 * np.sqrt(2.0 / (287.0 * 293.15)) / 1.185  # m^3/(s Pa) of 1 m^2


@pytest.mark.parametrize(
    ("value", "known", "which", "interval"),
    [
        (0.3, (0.25, 0.35), 0, (0.25, 0.35)),
        (0.3, None, 0, (0.0, 0.35 + 1.959964 * 0.2)),
        (0.8, None, 0, (0.0, 0.8)),
        (0.3, None, 1, (0.3, 0.5 + 1.959964 * 0.1)),
    ],
)
def test_the_models_interval_holds_or_what_is_usual_with_the_value_itself(
    value: float, known: Any, which: int, interval: tuple[float, float]
) -> None:
    """Usual are b 0.35 +- 0.2 and m 0.5 +- 0.1, never below 0."""
    found = iso6358._figure(value, known, which)
    assert found.value == value
    assert (found.low, found.high) == (pytest.approx(interval[0]), pytest.approx(interval[1]))


def estimate(name: str, value: float, low: float, high: float) -> Estimate:
    return Estimate(name, "1", value, 0.0, (low, high), False)


def test_the_critical_ratio_is_the_models_with_the_interval_of_the_effect_that_identified_it() -> None:
    assert iso6358._critical_ratio(model(), {}) == (model().base_values()["valve.critical_ratio"], None)
    (parameter,) = catalogue()["critical-ratio"].parameters
    name = f"critical-ratio.{parameter.name}"
    known = model(["critical-ratio"], {name: 0.3})
    assert iso6358._critical_ratio(known, {}) == (0.3, None)
    assert iso6358._critical_ratio(known, {name: estimate(name, 0.3, 0.25, 0.4)}) == (0.3, (0.25, 0.4))


@pytest.mark.parametrize("label", ["valve", "valve_2"])
def test_each_identified_area_gives_a_conductance(label: str) -> None:
    """All areas but that at -5 V are known, to a tenth."""
    valve = replace(VALVE, label=label)
    pairs = zip(valve.commands, valve.areas, strict=True)
    areas = [estimate(area_parameter_name(u, label), a, 0.9 * a, 1.1 * a) for u, a in pairs if u != -5.0]
    fitted: Any = SimpleNamespace(model=model(), estimates=areas)
    found = {one.u: one for one in iso_conductances(valve, fitted)}
    assert sorted(found) == [-10.0, 5.0, 10.0]
    for u, area in ((-10.0, 1.8e-6), (5.0, 0.9e-6)):
        c = found[u].C
        assert c.value == pytest.approx(UNIT * area)
        assert (c.low, c.high) == (pytest.approx(0.9 * UNIT * area), pytest.approx(1.1 * UNIT * area))
    assert (found[-10.0].b.value, found[-10.0].m.value) == (model().base_values()["valve.critical_ratio"], 0.5)
    assert found[-10.0].m.low == pytest.approx(0.5 - 1.959964 * 0.1)
    assert found[-10.0].b.high == pytest.approx(0.35 + 1.959964 * 0.2)
