"""Coverage, lack of fit, nodes, curves and the trend's memory, each by itself, in round numbers."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.identify.estimation.model_fit import free_parameters
from pneucli.identify.residuals import ChamberPressures
from pneucli.identify.valve import identification, maps, model_gradient
from pneucli.identify.valve.area_model import AreaModel
from pneucli.identify.valve.fit import Posterior, initial_pressures
from pneucli.identify.valve.lack_of_fit import LackOfFit, compare_with_map
from pneucli.identify.valve.maps import (
    Coverage,
    GradientMap,
    gradient_map,
    gradient_with_error,
    inverse_map,
    transient_coverage,
)
from pneucli.identify.valve.model_gradient import (
    ModelGradient,
    QuasiStaticGradient,
    has_memory,
    memory_gradient,
    whitening_matrix,
)
from pneucli.identify.valve.result import RecordingResidual, ValveIdentification
from pneucli.identify.valve.transients import Transients
from pneucli.simulate.model import parameter_value
from pneucli.simulate.run import simulate
from tests.simulate.synthetic_experiments import held_commands, make_experiment, model, time_grid

NONE: Any = None


# --- where recordings went


class Overlapped:
    """A valve that is shut up to 0.3 V."""

    def __init__(self, form: str = "map") -> None:
        self.form = form

    def __call__(self, u: np.ndarray) -> np.ndarray:
        return np.maximum(np.abs(u) - 0.3, 0.0)


SHUT: Any = SimpleNamespace(model_gradient=SimpleNamespace(valve=Overlapped()))
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


def laid(u: np.ndarray, p: np.ndarray, valid: np.ndarray | None = None, **more: Any) -> Transients:
    """Stretches (N, L) of these commands and pressures, sampled at 0.1 s."""
    samples, number = u.shape
    whole = np.ones(u.shape, dtype=bool) if valid is None else valid
    ones = np.ones(number, dtype=np.int64)
    known: dict[str, Any] = {
        "time": np.tile(0.1 * np.arange(samples)[:, None], number), "u": u, "supply": np.full(u.shape, 7e5), "p": p,
        "memory_gradient": np.zeros((samples, number, 1)), "valid": whole, "period": 0.1 * ones, "recording": 0 * ones,
        "averaged_readings": ones, "substeps": 1, "max_slope": 1e6,
    }  # fmt: skip
    return Transients(**(known | more))


def test_the_coverage_is_of_all_levels_and_the_pressures_that_each_saw() -> None:
    u = np.array([[5.0, -5.0], [5.0, -5.0], [6.0, 5.0]])
    p = np.array([[1e5, 7e5], [2e5, 6e5], [3e5, 9e5]])
    found = transient_coverage(SHUT, laid(u, p, np.array([[True, True], [True, True], [True, False]])))
    assert found.commands.tolist() == [-5.0, 5.0, 6.0]
    assert found.lowest.tolist() == [6e5, 1e5, 3e5]
    assert found.highest.tolist() == [7e5, 2e5, 3e5]


def test_of_very_many_levels_those_within_a_hundredth_of_the_largest_are_one_that_saw_what_each_saw() -> None:
    u = np.linspace(-2.0, 1.0, 800)[:, None]
    found = transient_coverage(SHUT, laid(u, 1e5 + u))
    assert found.commands == pytest.approx(np.linspace(-2.0, 1.0, 151), abs=1e-9)
    for level, lowest, highest in zip(found.commands, found.lowest, found.highest, strict=True):
        alike = 1e5 + u[np.abs(u - level) < 0.01]
        assert (lowest, highest) == (alike.min(), alike.max())


def test_two_hundred_levels_are_taken_as_they_are() -> None:
    u = np.linspace(0.0, 1.0, 200)[:, None] ** 2
    assert transient_coverage(SHUT, laid(u, 1e5 + u)).commands.tolist() == u[:, 0].tolist()


class Straight:
    """dp/dt = theta_0 u + theta_1 p, at any supply."""

    ambient, supply = 1e5, 7e5
    directions = (SimpleNamespace(sign=1, nodes=np.array([1.0, 4.0])), SimpleNamespace(sign=-1, nodes=np.array([4.0])))
    model_gradient, size = SHUT.model_gradient, 2
    command_grid = AreaModel.command_grid

    def gradient(self, theta: np.ndarray, u: np.ndarray, p: np.ndarray, supply: np.ndarray) -> np.ndarray:
        assert np.all(supply == 7e5)
        return np.asarray(theta[0] * u + theta[1] * p)

    def sensitivity(self, theta: np.ndarray, u: np.ndarray, p: np.ndarray, supply: np.ndarray) -> np.ndarray:
        return np.stack([u, p], axis=-1)


LAW: Any = Straight()
FIT: Any = Posterior(np.array([1e5, 0.1]), np.array([[9e6, 30.0], [30.0, 4e-4]]), np.zeros((0, 0)))


def test_the_error_of_a_gradient_is_that_of_its_parameters_together() -> None:
    value, error = gradient_with_error(LAW, FIT, np.array([2.0, -1.0]), np.array([1e5, 3e5]), np.full(2, 7e5))
    assert value == pytest.approx([2.1e5, -0.7e5])
    assert error == pytest.approx(np.sqrt([36e6 + 2 * 30.0 * 2e5 + 4e-4 * 1e10, 9e6 - 2 * 30.0 * 3e5 + 4e-4 * 9e10]))


def test_errors_are_the_same_whatever_part_of_the_derivatives_is_held_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    u, p = np.meshgrid(np.linspace(-2.0, 2.0, 5), [1e5, 3e5], indexing="ij")
    whole = gradient_with_error(LAW, FIT, u, p, np.full(u.shape, 7e5))
    held: list[int] = []

    class Counting(Straight):
        def sensitivity(self, theta: np.ndarray, u: np.ndarray, p: np.ndarray, supply: np.ndarray) -> np.ndarray:
            held.append(u.size)
            return super().sensitivity(theta, u, p, supply)

    for memory_of, parts in ((3, [3, 3, 3, 1]), (10, [10]), (0, [1] * 10)):
        monkeypatch.setattr(maps, "JACOBIAN_MEMORY", memory_of * 2 * 8)
        held.clear()
        value, error = gradient_with_error(Counting(), FIT, u, p, np.full(u.shape, 7e5))  # type: ignore[arg-type]
        assert (value.tolist(), error.shape) == (whole[0].tolist(), u.shape)
        assert error == pytest.approx(whole[1])
        assert held == parts


def test_the_map_has_95_percent_intervals_over_commands_and_pressures() -> None:
    u, p = np.array([-1.0, 2.0, 4.0]), np.array([1e5, 6e5])
    found = gradient_map(LAW, FIT, u, p, WENT)
    assert found.gradient == pytest.approx(1e5 * u[:, None] + 0.1 * p)
    error = gradient_with_error(LAW, FIT, np.array([4.0]), np.array([6e5]), np.array([7e5]))[1][0]
    assert found.ci_high[2, 1] - found.gradient[2, 1] == pytest.approx(1.959964 * error)
    assert found.gradient[2, 1] - found.ci_low[2, 1] == pytest.approx(1.959964 * error)
    assert found.covered.tolist() == [[False, False], [True, False], [False, False]]
    assert (found.u.tolist(), found.p.tolist()) == (u.tolist(), p.tolist())


def test_the_inverse_is_on_its_grid_and_answers_what_a_shut_valve_gives_by_the_middle() -> None:
    """The overlap from -0.3 to 0.3 V; gradients within the error of its own there are those of the shut valve."""
    sure = replace(FIT, covariance=np.diag([0.0, 1e-12]))
    gradients, p = np.array([-1e5, 3e4, 3e4 + 1.0, 4.5e5]), np.array([3e5, 4e5])
    found = inverse_map(LAW, sure, gradients, p, lambda u, p: np.ones(u.shape, dtype=bool))  # type: ignore[arg-type]
    assert found.u.shape == (4, 2)
    assert found.u[:, 0] == pytest.approx([-1.3, 0.0, 1e-5, 4.0], abs=1e-3)
    assert found.u[1, 1] == pytest.approx(-0.1)
    assert found.reachable.tolist() == [[True, True], [True, True], [True, True], [False, False]]
    unsure = replace(FIT, covariance=np.diag([0.0, 1e-4]))  # 3000 Pa/s at 3 bar
    near = inverse_map(LAW, unsure, 3e4 + np.array([-6e3, -5.8e3, 5.8e3, 6e3]), p[:1], WENT)
    assert near.u[:, 0] == pytest.approx([-0.06, 0.0, 0.0, 0.06], abs=1e-9)


def test_a_switching_valve_has_the_closest_gradient_reachable_within_its_interval() -> None:
    """At 3 bar -4 V, 0 and 4 V give -3.7e5, 3e4 and 4.3e5 Pa/s, to 3000 Pa/s."""

    class Switching(Straight):
        model_gradient = SimpleNamespace(valve=Overlapped("switching"))

    unsure = replace(FIT, covariance=np.diag([0.0, 1e-4]))
    asked = np.array([-9e5, -3.7e5 + 5.8e3, -3.7e5 + 6e3, -1e5, 3e4 - 5.8e3, 2e5, 4.3e5 - 6e3, 4.3e5 + 5.8e3])
    law: Any = Switching()
    found = inverse_map(law, unsure, asked, np.array([3e5]), lambda u, p: np.ones(u.shape, dtype=bool))  # type: ignore[arg-type]
    assert found.u[:, 0].tolist() == [-4.0, -4.0, -4.0, 0.0, 0.0, 0.0, 4.0, 4.0]
    assert found.reachable[:, 0].tolist() == [False, True, False, False, True, False, False, True]


# --- the model against the map


def lacking(difference: list[float], covered: list[bool], ci: float = 10.0, error: float = 5.0) -> LackOfFit:
    """A map of gradients 1000, 1000, 500 and 9 at one command, and a model that is off by ``difference``."""
    gradient = np.array([[1000.0, 1000.0, 500.0, 9.0]])
    grid = GradientMap(
        np.array([1.0]), np.arange(4.0), gradient, gradient - ci, gradient + ci, np.array([covered])
    )  # fmt: skip
    modelled: Any = SimpleNamespace(
        start=NONE,
        at_coordinates=lambda start: lambda u, p, supply: gradient - difference if np.all(supply == 7e5) else NONE,
        standard_error=lambda u, p, supply: np.full(u.shape, error),
    )
    return compare_with_map(modelled, 7e5, grid)


ALL = [True] * 4


def test_differences_count_where_data_covered_the_map_and_something_flows() -> None:
    """Below a hundredth of the largest gradient a share says little."""
    found = lacking([30.0, -10.0, 50.0, 9.0], ALL)
    assert found.difference.tolist() == [[30.0, -10.0, 50.0, 9.0]]
    assert found.has_flow.tolist() == [[True, True, True, False]]
    assert found.relative_difference[found.has_flow] == pytest.approx([0.03, 0.01, 0.1])
    assert (found.median, found.p95) == (pytest.approx(0.03), pytest.approx(0.093))
    some = lacking([30.0, -10.0, 50.0, 9.0], [True, True, False, True])
    assert some.has_flow.tolist() == [[True, True, False, False]]
    assert some.outside.tolist() == [[True, False, False, False]]
    assert (some.u.tolist(), some.p.tolist()) == ([[1.0] * 4], [[0.0, 1.0, 2.0, 3.0]])
    slow = lacking([30.0, -10.0, 50.0, 9.0], [False, False, True, True])  # 9 of 500: of the largest that was measured
    assert slow.has_flow.tolist() == [[False, False, True, True]]
    none = lacking([30.0, -10.0, 50.0, 9.0], [False] * 4)
    assert (none.median, none.p95, none.share_outside, none.is_significant) == (None, None, None, False)


@pytest.mark.parametrize(
    ("ci", "error", "share"), [(10.0, 5.0, 2 / 3), (29.0, 5.0, 2 / 3), (31.0, 5.0, 1 / 3), (10.0, 16.0, 1 / 3)]
)
def test_outside_is_what_neither_interval_allows_for(ci: float, error: float, share: float) -> None:
    assert lacking([30.0, -9.0, 50.0, 9.0], ALL, ci, error).share_outside == pytest.approx(share)


@pytest.mark.parametrize(
    ("difference", "noticeable"), [([21.0, 0, 0, 0], True), ([19.0, 0, 0, 0], False), ([0, 0, 0, 9.0], False)]
)
def test_more_than_a_fiftieth_of_the_gradient_is_noticeable(difference: list[float], noticeable: bool) -> None:
    assert lacking(difference, ALL, ci=2.0, error=1.0).is_significant == noticeable


def test_at_more_than_a_twentieth_of_the_points() -> None:
    for off, noticeable in ((5, False), (6, True)):
        modelled = np.where(np.arange(100) < off, 500.0, 1000.0)
        measured, none = np.full(100, 1000.0), np.zeros(100)
        found = LackOfFit(NONE, NONE, modelled, none, measured, none, np.ones(100, dtype=bool))
        assert found.is_significant == noticeable


# --- the identification's own pieces


def test_commands_that_were_held_for_three_tenths_of_a_second_are_nodes() -> None:
    u = np.array([[1.0, 5.0, -4.0], [1.0, 5.0, -4.0], [1.0, 8.0, -4.0], [2.0, 8.0, -4.0]])
    p = np.full(u.shape, 2e5)
    assert identification._nodes(laid(u, p), 1) == pytest.approx([1.0, 8.0])  # 2 V for 0.1 s, 5 V for 0.2 s
    assert identification._nodes(laid(u, p), -1) == pytest.approx([4.0])
    assert identification._nodes(laid(u, p, u != 1.0), 1) == pytest.approx([8.0])
    assert identification._nodes(laid(u, p, period=np.array([0.1, 0.15, 0.1])), 1) == pytest.approx([1.0, 5.0, 8.0])
    assert identification._nodes(laid(np.zeros((4, 1)), p[:, :1]), 1).size == 0
    top = np.array([[4.0], [4.0], [4.0], [4.02]])  # not the same, but as near as 1 %
    assert identification._nodes(laid(top, p[:, :1]), 1) == pytest.approx([4.0], abs=0.005)


def test_residual_over_noise_is_a_root_mean_square_over_the_recordings_of_a_use() -> None:
    rows = (
        RecordingResidual("a", "train", 3.0),
        RecordingResidual("b", "train", 4.0),
        RecordingResidual("c", "test", 2.0),
    )
    found = ValveIdentification(
        *[NONE] * 8, rows, max_gradient=3.0, max_measured_gradient=1.0, coverage=NONE, area_model=NONE, posterior=NONE
    )
    assert (found.residual_to_noise("train"), found.residual_to_noise("test")) == (pytest.approx(np.sqrt(12.5)), 2.0)
    assert found.residual_to_noise("else") is None
    assert found.is_consistent
    assert not replace(found, max_gradient=3.01).is_consistent


def test_curves_are_transients_at_a_constant_command_other_than_zero() -> None:
    u = np.array([[2.0, 0.0, 3.0], [2.0, 0.0, 3.5], [9.0, 0.0, 3.5]])
    p = np.array([[1e5, 2e5, 3e5], [1.1e5, 2e5, 3e5], [9e5, 2e5, 3e5]])
    valid = np.ones((3, 3), dtype=bool)
    valid[2, 0] = False
    data = laid(u, p, valid, recording=np.array([1, 0, 0]))
    fit = replace(FIT, simulated=p + 5.0)
    recorded: Any = [SimpleNamespace(name="a"), SimpleNamespace(name="b")]
    (curve,) = identification._curves(LAW, fit, data, recorded)
    assert (curve.recording, curve.u) == ("b", 2.0)
    assert (curve.time.tolist(), curve.measured.tolist(), curve.fitted.tolist()) == (
        [0.0, 0.1], [1e5, 1.1e5], [100_005.0, 110_005.0],
    )  # fmt: skip
    value, error = gradient_with_error(LAW, fit, np.full(2, 2.0), curve.fitted, np.full(2, 7e5))
    assert curve.gradient == pytest.approx(value)
    assert curve.ci_low == pytest.approx(value - 1.959964 * error)
    assert curve.ci_high == pytest.approx(value + 1.959964 * error)


def test_curves_start_at_their_first_readings_or_at_the_median_of_all() -> None:
    p = np.array([[1e5, np.nan], [2e5, 4e5], [3e5, 9e5]])
    assert initial_pressures(laid(np.ones((3, 2)), p)).tolist() == [1e5, 3e5]


# --- the trend


def test_units_make_errors_independent_and_of_size_one() -> None:
    covariance = np.array([[4.0, 1.0], [1.0, 9.0]])
    found = whitening_matrix(covariance, 1e-3)
    assert found @ covariance @ found.T == pytest.approx(np.eye(2))
    poor = whitening_matrix(np.diag([1e-12, 4.0]), 0.1)
    assert sorted(np.abs(poor[poor != 0.0])) == pytest.approx([0.5, 10.0])


def test_nothing_is_less_certain_than_anything_between_its_bounds() -> None:
    """Even over a width w it errs by w / sqrt(12); what is known with it shrinks alike."""
    wide = model_gradient._limited_covariance(
        np.array([[100.0, 3.0], [3.0, 0.25]]), (np.array([0.0, -1e9]), np.array([12.0, 1e9]))
    )
    assert wide[0, 0] == pytest.approx(12.0)
    assert wide[0, 1] == pytest.approx(3.0 * np.sqrt(0.12))
    assert wide[1, 1] == 0.25
    narrow = model_gradient._limited_covariance(np.array([[1e-4]]), (np.zeros(1), np.array([0.012])))
    assert narrow[0, 0] == pytest.approx(0.012**2 / 12.0)
    assert model_gradient._limited_covariance(np.zeros((1, 1)), (np.zeros(1), np.ones(1))).tolist() == [[0.0]]


def quiet(names: list[str], values: dict[str, float], restarts: tuple[int, ...] = (0,)) -> tuple[Any, Any]:
    time = time_grid(1.0)
    u = held_commands(time, [0.0, 6.0, -6.0, 0.0], 0.25)
    test = make_experiment("valve", time, {"u": u, "p1": 3e5}, restarts=restarts)
    known = model(names, values | {"rig.vessel_volume": 2e-4})
    return known, test


def test_a_valve_without_memory_has_its_quasi_static_gradient() -> None:
    """Nor are there derivatives, which would take the room of as many simulations."""
    known, test = quiet([], {})
    assert not has_memory(known)
    beside = ModelGradient(known, test, NONE, np.zeros(2), NONE).memory_gradient(test)
    assert beside.shape == (1, test.time.size)
    assert not beside.any()


def test_a_memory_comes_with_its_derivatives() -> None:
    name = "heat-transfer.conductance"
    known, test = quiet(["heat-transfer"], {name: 0.7})
    assert has_memory(known)
    free: Any = (SimpleNamespace(name=name, from_coordinate=lambda z: 0.7 + z),)
    beside = ModelGradient(known, test, free, np.zeros(1), NONE).memory_gradient(test)
    more = memory_gradient(quiet(["heat-transfer"], {name: 0.701})[0], test)
    assert beside[0] == pytest.approx(memory_gradient(known, test))
    assert np.abs(beside[1]).max() > 1e3
    assert beside[1] == pytest.approx((more - beside[0]) / 1e-3)


@pytest.mark.parametrize("chamber", [1, 2])
def test_the_valve_of_a_model_gradient_belongs_to_the_tested_chamber(chamber: int) -> None:
    both: Any = SimpleNamespace(valve_of_chamber={1: "first", 2: "second"}.get)
    of: Any = SimpleNamespace(recording=SimpleNamespace(chamber=chamber))
    assert str(ModelGradient(both, of, NONE, NONE, NONE).valve) == {1: "first", 2: "second"}[chamber]


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


def test_the_prior_is_three_standard_errors_wide() -> None:
    free = tuple(
        SimpleNamespace(name=n, lower=-1e3, upper=1e3, to_coordinate=lambda v: v, from_coordinate=lambda z: z)
        for n in "ab"
    )
    one = ModelGradient(NONE, NONE, free, np.zeros(2), np.diag([4.0, 0.01]))  # type: ignore[arg-type]
    assert np.sort(np.abs(one.prior_whitening).ravel()) == pytest.approx([0.0, 0.0, 1 / 6.0, 1 / 0.3])
    sure = ModelGradient(NONE, NONE, free, np.zeros(2), np.zeros((2, 2)))  # type: ignore[arg-type]
    assert np.diag(np.abs(sure.prior_whitening)) == pytest.approx([1e3, 1e3])


def test_the_sensitivity_to_a_parameter_is_a_central_difference() -> None:
    class Square(ModelGradient):
        def at_coordinates(self, z: np.ndarray) -> Any:
            return lambda u, p, supply: u * z[0] ** 2 + p * z[1]

    still: Any = SimpleNamespace(valve_parameters=dict)
    one = Square(still, NONE, (), np.array([3.0, 1.0]), np.diag([0.01, 4.0]))
    at = np.array([2.0, 5.0]), np.array([10.0, 1.0]), np.zeros(2)
    assert one.sensitivity(np.array([3.0, 1.0]), *at) == pytest.approx(np.array([[12.0, 10.0], [30.0, 1.0]]))
    assert one.standard_error(*at) == pytest.approx(np.sqrt([1.44 + 400.0, 9.0 + 4.0]))


@pytest.mark.parametrize(
    "values", [{"chamber-leak.area": 2e-8}, {"pump-flow.slip": 8e-10, "pump-flow.clearance": 0.1}], ids=["leak", "pump"]
)
def test_the_sensitivity_to_areas_and_overlaps_is_that_of_differences(values: dict[str, float]) -> None:
    """Beside a leak or the slip of a pump, whose parameters are no areas, and at commands beyond all knots."""
    known, test = quiet([next(iter(values)).partition(".")[0]], values)
    known = replace(known, valve=replace(known.valve, overlap_fill=0.3))
    free = free_parameters(known, [ChamberPressures(test)])
    start = np.array([f.to_coordinate(parameter_value(known, f.name)) for f in free])
    one = ModelGradient(known, test, tuple(free), start, np.eye(start.size))
    u, p = np.linspace(-12.0, 12.0, 40), np.linspace(1.2e5, 6e5, 40)
    found = one.sensitivity(start, u, p, np.full(40, 7e5))
    for j, step in enumerate(1e-4 * np.eye(start.size)):
        above, below = (one.at_coordinates(start + s)(u, p, np.full(40, 7e5)) for s in (step, -step))
        slope = (above - below) / 2e-4
        assert found[:, j] == pytest.approx(slope, abs=2e-3 * np.abs(slope).max())
        assert slope.any()
