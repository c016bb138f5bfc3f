"""The valve's law and its fit, held to their definitions: derivatives by differences, curves by an exact solution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pneucli.errors import InputError
from pneucli.identify.valve.fit import Round, autocovariances, inverse, sensitivities, simulate, whitener
from pneucli.identify.valve.law import LEAK, OWN, SHARED, Direction, Law, flow_function, polynomial
from pneucli.identify.valve.maps import GradientMap, InverseMap, commands_for
from pneucli.identify.valve.stretches import Stretches, cut
from pneucli.recording import Recording

RNG = np.random.default_rng
AMBIENT, SUPPLY = 1e5, 7e5
NODES = (np.array([1.0, 3.0, 8.0]), np.array([2.0, 9.0]))


def law() -> tuple[Law, np.ndarray]:
    """Both directions, with corrections and a leak that are not small."""
    found = Law((Direction(1, NODES[0]), Direction(-1, NODES[1])), 1e7, AMBIENT, SUPPLY, 2e6)
    theta = 0.02 * RNG(1).standard_normal(found.size)
    for offset in found.offsets():
        theta[offset : offset + 3] = np.log(2e-6), 0.4, 1.2
    return found, theta


LAW, THETA = law()
U = np.array([0.6, 2.0, 5.0, 8.0, -0.7, -3.0, -9.0, 4.0])
P = np.array([2e5, 3e5, 6.5e5, 1.5e5, 4e5, 1.2e5, 6e5, 6.9e5])
S = np.full(8, SUPPLY)


def test_a_polynomial_is_summed_from_its_lowest_power() -> None:
    assert polynomial(np.array([2.0, -1.0]), np.array([1.0, 10.0, 100.0])) == pytest.approx([421.0, 91.0])


@pytest.mark.parametrize(("r", "share"), [(0.0, 1.0), (0.528, 1.0), (0.764, 0.75**0.5), (1.0, 0.0)])
def test_flow_is_choked_then_falls_on_an_ellipse_to_nothing(r: float, share: float) -> None:
    assert flow_function(np.array([r]))[0] == pytest.approx(0.484 * share, abs=1e-9)


def test_the_last_approach_to_equilibrium_is_linear() -> None:
    close = flow_function(1.0 - np.array([2e-3, 1e-3, 0.5e-3]))
    assert close[1] == pytest.approx(0.5 * close[0])
    assert close[2] == pytest.approx(0.25 * close[0])


def test_weights_are_hats_over_the_logarithm_of_the_command() -> None:
    d = Direction(-1, np.array([1.0, 4.0]))
    assert d.weights(np.array([-0.5, -1.0, -2.0, -4.0, -9.0])) == pytest.approx(
        np.array([[1, 0], [1, 0], [0.5, 0.5], [0, 1], [0, 1]])
    )


def test_an_opening_is_the_command_beyond_the_overlap_with_a_smooth_floor() -> None:
    d = Direction(-1, np.array([1.0, 10.0]))
    assert d.opening(np.array([-4.0, -0.5]), 0.5) == pytest.approx([3.5, 0.5 * 5e-3], rel=1e-5)
    assert 0.0 < d.opening(np.array([-0.1]), 0.5)[0] < 1e-4


def test_each_parameter_has_its_place() -> None:
    assert LAW.offsets() == [0, 3 + SHARED + 3 * OWN]
    assert LAW.size == 6 + 2 * SHARED + 5 * OWN + LEAK
    groups = LAW.groups()
    places = np.concatenate([*groups.values(), [o + k for o in LAW.offsets() for k in range(3)]])
    assert sorted(places) == list(range(LAW.size))
    assert groups["leak"].tolist() == list(range(LAW.size - LEAK, LAW.size))
    assert (groups["shared"].size, groups["own"].size) == (2 * SHARED, 5 * OWN)
    assert groups["shared"][0] == 3
    assert groups["own"][0] == 3 + SHARED


@pytest.mark.parametrize(
    ("u", "p", "upstream", "ratio"),
    [(5.0, 3.5e5, 7e5, 0.5), (-5.0, 4e5, -4e5, 0.25), (5.0, 8e5, -8e5, 7 / 8), (-5.0, 0.5e5, 1e5, 0.5)],
)
def test_gas_flows_from_the_higher_pressure(u: float, p: float, upstream: float, ratio: float) -> None:
    found = LAW.ratio(np.array([u]), np.array([p]), np.array([SUPPLY]))
    assert (found[0][0], found[1][0]) == (pytest.approx(upstream), pytest.approx(ratio))


@pytest.mark.parametrize(("u", "p", "sign"), [(5.0, 3e5, 1.0), (-5.0, 3e5, -1.0)])
def test_without_corrections_it_is_area_and_flow_function(u: float, p: float, sign: float) -> None:
    bare = np.zeros(LAW.size)
    for offset in LAW.offsets():
        bare[offset : offset + 3] = np.log(2e-6), 0.4, 1.2
    top = 8.0 if u > 0 else 9.0
    area = 2e-6 * ((5.0 - 0.4) / (top - 0.4)) ** 1.2
    up, down = (SUPPLY, p) if u > 0 else (p, AMBIENT)
    wanted = sign * 1e7 * up * area * flow_function(np.array([down / up]))[0]
    assert LAW.gradient(bare, np.array([u]), np.array([p]), np.array([SUPPLY]))[0] == pytest.approx(wanted, rel=1e-6)


def test_a_leak_is_a_cubic_of_pressure_between_ambient_and_supply() -> None:
    theta = THETA.copy()
    theta[-LEAK:] = 1.0, 2.0, 3.0, 4.0
    found = LAW.leak(theta, np.array([0.0, AMBIENT, 4e5, SUPPLY, 9e5]))
    assert found == pytest.approx(2e6 * np.array([1.0, 1.0, 1 + 1 + 0.75 + 0.5, 10.0, 10.0]))


def test_the_sensitivity_is_the_derivative_of_the_gradient() -> None:
    found = LAW.sensitivity(THETA, U, P, S)
    assert found.shape == (8, LAW.size)
    for k, row in enumerate(1e-6 * np.eye(LAW.size)):
        slope = (LAW.gradient(THETA + row, U, P, S) - LAW.gradient(THETA - row, U, P, S)) / 2e-6
        assert found[:, k] == pytest.approx(slope, rel=2e-4, abs=1e-5 * np.abs(found).max())


# --- curves


def stretches(period: float = 1e-3, samples: int = 300) -> Stretches:
    """A charge at 5 V and a discharge at -6 V, the second 60 samples shorter."""
    time = period * np.arange(samples)
    grid = np.broadcast_to(time[:, None], (samples, 2))
    valid = np.arange(samples)[:, None] < np.array([samples, samples - 60])
    u, p = np.broadcast_to([5.0, -6.0], grid.shape), np.broadcast_to([2e5, 6e5], grid.shape).copy()
    return Stretches(grid, u, np.full(grid.shape, SUPPLY), p, valid, np.full(2, period), np.arange(2))


START = np.array([1.5e5, 6e5])


@pytest.mark.parametrize("period", [1e-3, 4e-3])
def test_a_simulated_curve_is_the_exact_one(period: float) -> None:
    s = stretches(period)
    found = simulate(LAW, THETA, START, s)
    for k, u in enumerate((5.0, -6.0)):

        def slope(_: float, p: np.ndarray, u: float = u) -> np.ndarray:
            return LAW.gradient(THETA, np.array([u]), p, np.array([SUPPLY]))

        exact = solve_ivp(slope, (0.0, s.time[-1, k]), START[k : k + 1], t_eval=s.time[:, k], rtol=1e-9, max_step=2e-3)
        assert found[:, k] == pytest.approx(exact.y[0], rel=2e-4)


def test_sensitivities_of_a_curve_are_its_differences() -> None:
    s = stretches()
    p = simulate(LAW, THETA, START, s)
    by_theta, by_start = sensitivities(LAW, THETA, p, s)
    ahead, behind = (simulate(LAW, THETA, START + d, s) for d in (10.0, -10.0))
    assert by_start == pytest.approx((ahead - behind) / 20.0, abs=5e-3)
    for k in (0, 1, 2, 5, LAW.offsets()[1], LAW.size - 1):
        row = 1e-5 * np.eye(LAW.size)[k]
        slope = (simulate(LAW, THETA + row, START, s) - simulate(LAW, THETA - row, START, s)) / 2e-5
        off = np.abs(by_theta[..., k] - slope) / np.abs(slope).max()
        assert np.median(off) < 1e-3
        assert off.max() < 0.1  # at the kink of the flow function


def problem(noise: float = 300.0) -> tuple[Round, np.ndarray]:
    s = stretches()
    p = simulate(LAW, THETA, START, s)
    s.p[:] = p + noise * RNG(2).standard_normal(p.shape)
    return Round(LAW, s, np.array([1.0, -0.5]), noise, np.full(LAW.size, 2.0)), p


def test_a_signal_is_whitened_by_the_filter_where_all_of_it_is_seen() -> None:
    one, _ = problem()
    ones = np.ones((300, 2))
    found = one.white(ones)
    assert found.shape == (299, 2)
    assert found[:, 0] == pytest.approx(np.full(299, 0.5 / 300.0))
    assert np.flatnonzero(found[:, 1] == 0.0).tolist() == list(range(239, 299))
    assert one.white(np.ones((300, 2, 3)))[..., 1] == pytest.approx(found)


def test_the_cost_is_whitened_squares_and_priors() -> None:
    one, p = problem()
    error = p - one.data.p
    assert one.cost(THETA, p) == pytest.approx(np.sum(one.white(error) ** 2) + 4.0 * np.sum(THETA**2))


def test_the_normal_equations_are_those_of_the_cost_with_the_starts_eliminated() -> None:
    one, p = problem()
    gradient, hessian, cross, start_gradient = one.normal_equations(THETA, p)
    by_theta, by_start = sensitivities(LAW, THETA, p, one.data)
    blocks = [one.white(by_theta).reshape(-1, LAW.size)]
    starts = np.zeros((299, 2, 2))
    for k in (0, 1):
        starts[:, k, k] = one.white(by_start)[:, k]
    jacobian = np.hstack([blocks[0], starts.reshape(-1, 2)])
    target = one.white(p - one.data.p).ravel()
    whole = jacobian.T @ jacobian + np.diag([*np.full(LAW.size, 4.0), 0.0, 0.0])
    slope = jacobian.T @ target + np.concatenate([4.0 * THETA, [0.0, 0.0]])
    step = np.linalg.solve(whole, slope)
    assert np.linalg.solve(hessian, gradient) == pytest.approx(step[:-2], rel=2e-3, abs=1e-6)
    assert start_gradient - cross.T @ step[:-2] == pytest.approx(step[-2:], rel=1e-3)


def test_the_inverse_of_what_is_not_told_is_nothing() -> None:
    assert inverse(np.diag([2.0, 4.0])) == pytest.approx(np.diag([0.5, 0.25]))
    assert inverse(np.diag([2.0, 0.0])) == pytest.approx(np.diag([0.5, 0.0]))


def test_an_ar_process_is_whitened_by_its_own_coefficients() -> None:
    """AR(1) with pole 0.8 and deviation 5."""
    filter_, innovations = whitener(25.0 * 0.8 ** np.arange(5))
    assert filter_ == pytest.approx([1.0, -0.8, 0.0, 0.0, 0.0], abs=1e-4)
    assert innovations == pytest.approx(5.0 * 0.6, rel=1e-4)
    alone, level = whitener(np.array([9.0]))
    assert (alone.tolist(), level) == ([1.0], pytest.approx(3.0, rel=1e-5))


def test_autocovariances_are_means_over_the_pairs_that_were_seen() -> None:
    residual = np.array([[1.0, 2.0], [2.0, 2.0], [3.0, 9.0]] * 30)
    valid = np.array([[True, True], [True, True], [True, False]] * 30)
    found = autocovariances(residual, valid)
    assert found.size == 5  # a twentieth of 90 samples
    assert found[0] == pytest.approx((30 * (1 + 4 + 9) + 60 * 4) / 150)
    assert found[1] == pytest.approx((30 * (2 + 6) + 29 * 3 + 30 * 4) / (89 + 30))
    assert autocovariances(residual[:19], valid[:19]).size == 1
    assert autocovariances(np.tile(residual, (9, 1)), np.tile(valid, (9, 1))).size == 9


# --- maps


def test_commands_lead_back_to_their_gradients() -> None:
    bare = np.zeros(LAW.size)
    for offset in LAW.offsets():
        bare[offset : offset + 3] = np.log(2e-6), 0.4, 1.2
    u = np.array([-8.0, -2.0, 1.0, 3.0, 7.0])
    p = np.full(5, 3e5)
    gradient = LAW.gradient(bare, u, p, np.full(5, SUPPLY))
    found, reachable = commands_for(LAW, bare, gradient, p)
    assert found == pytest.approx(u, abs=0.02)
    assert reachable.all()
    ends = LAW.gradient(bare, np.array([-9.0, 8.0]), p[:2], S[:2])
    beyond, far = commands_for(LAW, bare, 1.01 * ends, p[:2])
    assert beyond.tolist() == [-9.0, 8.0]
    assert not far.any()
    at_end, reached = commands_for(LAW, bare, ends, p[:2])
    assert reached.all()
    assert at_end == pytest.approx([-9.0, 8.0])


def test_maps_scale_with_the_volume() -> None:
    one = np.ones((2, 2))
    scaled = GradientMap(np.zeros(2), np.zeros(2), one, 0.5 * one, 2.0 * one, one > 0).scaled(3.0)
    assert (scaled.gradient[0, 0], scaled.ci_low[0, 0], scaled.ci_high[0, 0]) == (3.0, 1.5, 6.0)
    back = InverseMap(np.array([2.0]), np.zeros(2), one, one > 0).scaled(3.0)
    assert (back.p_gradient.tolist(), back.u[0, 0]) == ([6.0], 1.0)


# --- stretches


def test_a_recording_is_cut_at_jumps_of_the_command() -> None:
    """Jumps cut a recording; 30 ms after each are left out, and so is what does not last 30 ms beyond."""
    time = 1e-3 * np.arange(400)
    u = np.repeat([0.0, 5.0, -5.0, 3.0], [100, 100, 50, 150])
    recorded = Recording("r", "valve", "train", time, {"u": u, "p1": 1e5 + time})
    found = cut([recorded], SUPPLY)
    assert found.valid.sum(axis=0).tolist() == [100, 70, 120]
    assert found.u[0].tolist() == [0.0, 5.0, 3.0]
    assert found.time[0] == pytest.approx([0.0, 0.130, 0.280])
    assert np.all(found.supply == SUPPLY)
    assert found.period == pytest.approx(np.full(3, 1e-3))
    assert found.recording.tolist() == [0, 0, 0]


def test_a_ramp_is_no_jump_and_unmeasured_pressures_are_not_valid() -> None:
    time = 1e-3 * np.arange(400)
    p = np.where(np.arange(400) == 7, np.nan, 2e5)
    found = cut([Recording("r", "valve", "train", time, {"u": np.linspace(0.0, 1.0, 400), "p1": p})], SUPPLY)
    assert found.valid.shape == (400, 1)
    assert np.flatnonzero(~found.valid[:, 0]).tolist() == [7]


def test_a_recorded_supply_is_averaged_over_a_tenth_of_a_second() -> None:
    time = 1e-3 * np.arange(1000)
    supply = SUPPLY + 1e4 * np.where(np.arange(1000) % 2, 1.0, -1.0)
    signals = {"u": np.full(1000, 5.0), "p1": np.full(1000, 2e5), "p_supply": supply}
    found = cut([Recording("r", "valve", "train", time, signals)], None)
    assert found.supply[60:-60] == pytest.approx(np.full((880, 1), SUPPLY), abs=200.0)
    ramp = dict(signals, p_supply=SUPPLY + 1e5 * time)
    assert cut([Recording("r", "valve", "train", time, ramp)], None).supply[500, 0] == pytest.approx(
        SUPPLY + 5e4, rel=1e-4
    )


@pytest.mark.parametrize(
    ("signals", "says"),
    [
        ({"p1": np.ones(100)}, "no signal u"),
        ({"u": np.ones(100)}, "no signal p1"),
        ({"u": np.ones(100), "p1": np.ones(100)}, "no signal p_supply.*set rig.supply_pressure"),
        (
            {"u": np.arange(100.0) % 2, "p1": np.ones(100), "p_supply": np.ones(100)},
            "no command is held longer than 60 ms",
        ),
    ],
)
def test_what_is_missing_of_a_valve_test_is_named(signals: dict[str, np.ndarray], says: str) -> None:
    with pytest.raises(InputError, match=f"(?s){says}"):
        cut([Recording("r", "valve", "train", 1e-3 * np.arange(100), signals)], None)


def test_uneven_sampling_is_refused() -> None:
    time = np.cumsum(1e-3 * (1.0 + 0.3 * RNG(1).uniform(-1.0, 1.0, 400)))
    with pytest.raises(InputError, match="sampled unevenly"):
        cut([Recording("r", "valve", "train", time, {"u": np.ones(400), "p1": np.ones(400)})], SUPPLY)
