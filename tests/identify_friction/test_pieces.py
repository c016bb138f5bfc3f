"""The pieces of the identification of friction, each by hand: curves, laws, averages, velocities, levels."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

from pneucli.identify.friction import regression
from pneucli.identify.friction.friction_model import TITLES, FrictionModel, ModelBranch, VelocityDomain
from pneucli.identify.friction.imposed_motion import kinetic_friction
from pneucli.identify.friction.kinematics import fuse_position_and_acceleration
from pneucli.identify.friction.regression import (
    FrictionFit,
    fit_coulomb,
    fit_stribeck,
    scaled_residual,
    velocity_friction,
)
from pneucli.identify.friction.samples import MovingSamples, binned_curve
from pneucli.identify.friction.stick_slip import StickSlip, average_stick_slips
from pneucli.noise import NoiseModel
from pneucli.quantities import Z95
from pneucli.simulate.velocity_integration import (
    MIN_REST_SAMPLES,
    correlation_samples,
    integrate_between_rests,
    rest_mask,
)

RNG = np.random.default_rng


def samples(v: Any, friction: Any, **given: Any) -> MovingSamples:
    v, friction = np.asarray(v, float), np.asarray(friction, float)
    sure = {"sigma": np.ones_like(v), "branch": np.ones(v.size, np.int8), "block": np.arange(v.size)}
    return MovingSamples(**{"v": v, "a": np.zeros_like(v), "drive": friction, "friction": friction, **sure, **given})


# --- samples and curves


def test_samples_are_kept_together() -> None:
    s = samples([1.0, -2.0, 3.0], [10.0, 20.0, 30.0], a=np.array([4.0, 5.0, 6.0]))
    kept = s.select(np.array([True, False, True]))
    assert (kept.v.tolist(), kept.a.tolist(), kept.friction.tolist(), kept.block.tolist()) == (
        [1.0, 3.0], [4.0, 6.0], [10.0, 30.0], [0, 2],
    )  # fmt: skip
    assert (len(s), len(kept)) == (3, 2)


@pytest.mark.parametrize(("forward", "both"), [(0, False), (9, False), (10, True), (50, True), (90, True), (91, False)])
def test_both_directions_have_at_least_a_tenth_each(forward: int, both: bool) -> None:
    v = np.where(np.arange(100) < forward, 1.0, -1.0)
    assert samples(v, v).both_directions == both
    assert not samples([], []).both_directions


def test_a_curve_has_the_mean_and_the_interval_of_its_bins_by_blocks() -> None:
    """All at one speed: 6 blocks of 20 samples whose means scatter by 2, samples within them by 1."""
    rng = RNG(1)
    block = np.repeat(np.arange(6), 20)
    force = 10.0 + 2.0 * rng.standard_normal(6)[block] + rng.standard_normal(120)
    found = binned_curve(samples(np.full(120, 0.1), force, block=block), "both")
    means = np.array([force[block == k].mean() for k in range(6)])
    half = student.ppf(0.975, 5) * np.std(means, ddof=1) / np.sqrt(6)
    assert found.v == pytest.approx([0.1])
    assert found.force == pytest.approx([force.mean()])
    assert found.ci_high - found.force == pytest.approx([half])
    assert found.force - found.ci_low == pytest.approx([half])
    assert found.count.tolist() == [120]


def test_too_few_blocks_have_the_interval_of_the_sensors_noise() -> None:
    found = binned_curve(samples([0.1, 0.1], [9.0, 11.0], sigma=np.array([2.0, 4.0])), "both")
    assert found.ci_high - found.force == pytest.approx([Z95 * 3.0 / 2**0.5])


def test_bins_are_finer_toward_standstill_and_keep_the_directions_apart() -> None:
    """Edges at the squares of k / 40 of the highest speed."""
    v = np.array([1.0, 0.96, 0.94, 0.0007, 0.0005, -0.0005, -0.96])
    found = binned_curve(samples(v, np.arange(7.0)), "both")
    assert found.v == pytest.approx([-0.96, -0.0005, 0.0005, 0.0007, 0.94, 0.98])
    assert found.force == pytest.approx([6.0, 5.0, 4.0, 3.0, 2.0, 0.5])
    assert found.count.tolist() == [1, 1, 1, 1, 1, 2]


@pytest.mark.parametrize(("branch", "force"), [("accelerating", 3.0), ("slowing", 1.0), ("both", 2.0)])
def test_a_branch_takes_its_own_samples(branch: Any, force: float) -> None:
    s = samples([0.1, 0.1, 0.1], [1.0, 2.0, 3.0], branch=np.array([-1, 0, 1], np.int8))
    found = binned_curve(s, branch)
    assert found.branch == branch
    assert found.force == pytest.approx([force])


def test_no_samples_make_an_empty_curve() -> None:
    found = binned_curve(samples([0.1], [1.0]), "slowing")
    assert [x.size for x in (found.v, found.force, found.ci_low, found.ci_high, found.count)] == [0] * 5


# --- laws


V = np.concatenate([-np.linspace(0.003, 0.3, 2000), np.linspace(0.003, 0.3, 2000)])


def truth(coulomb: float = 12.0, viscous: float = 40.0, static: float = 12.0, velocity: float = 0.02) -> np.ndarray:
    dry = coulomb + (static - coulomb) / (1.0 + (V / velocity) ** 2)
    return dry * np.sign(V) + viscous * V


def measured(force: np.ndarray, seed: int = 1, **given: Any) -> MovingSamples:
    block = np.arange(V.size) // 20
    return samples(V, force + 0.5 * RNG(seed).standard_normal(V.size), sigma=np.full(V.size, 0.5), block=block, **given)


def test_a_fit_is_dry_and_viscous_friction_with_an_optional_stribeck_effect() -> None:
    v = np.array([-0.02, 0.0, 0.02, 0.2])
    plain = {"coulomb": 12.0, "viscous": 40.0, "static": 20.0, "velocity": 0.0}
    assert velocity_friction(v, plain) == pytest.approx([-12.8, 0.0, 12.8, 20.0])
    assert velocity_friction(v, plain | {"velocity": 0.02}) == pytest.approx([-16.8, 0.0, 16.8, 20.0 + 8.0 / 101.0])


def test_coulomb_and_viscous_friction_are_found_with_honest_errors() -> None:
    values = [fit_coulomb(measured(truth(), seed), offset=True).values() for seed in range(30)]
    for name, true, unit in (("coulomb", 12.0, "N"), ("viscous", 40.0, "N s/m"), ("offset", 0.0, "N")):
        found = np.array([v[name].value for v in values])
        half = np.array([v[name].high - v[name].value for v in values])
        assert {v[name].unit for v in values} == {unit}
        assert np.mean(found) == pytest.approx(true, abs=np.mean(half))
        assert np.mean(half) / Z95 == pytest.approx(np.std(found), rel=0.4)
        assert np.mean(np.abs(found - true) < half) > 0.8


def test_a_constant_force_is_fitted_on_request_and_may_be_negative() -> None:
    pushed = measured(truth() - 5.0)
    found = fit_coulomb(pushed, offset=True)
    assert found["offset"] == pytest.approx(-5.0, abs=0.1)
    assert found["coulomb"] == pytest.approx(12.0, abs=0.15)
    assert found.values()["offset"].low < -5.0 < found.values()["offset"].high
    assert "offset" not in fit_coulomb(pushed, offset=False).names
    assert fit_coulomb(pushed, offset=False)["offset"] == 0.0


def test_a_mass_is_fitted_to_the_drive() -> None:
    a = 5.0 * RNG(3).standard_normal(V.size)
    s = measured(truth(), a=a, drive=truth() + 2.5 * a + 0.5 * RNG(4).standard_normal(V.size))
    found = fit_coulomb(s, offset=False, mass=True).values()
    assert found["mass"].value == pytest.approx(2.5, abs=0.02)
    assert found["mass"].unit == "kg"


def test_friction_is_never_negative() -> None:
    found = fit_coulomb(measured(-truth()), offset=False).values()
    assert found["coulomb"].value == pytest.approx(0.0, abs=1e-6)
    assert min(found["coulomb"].low, found["viscous"].low) == 0.0


def test_the_deviation_of_a_fit_is_relative_to_the_sensors_noise() -> None:
    assert fit_coulomb(measured(truth()), offset=False).deviation == pytest.approx(1.0, abs=0.05)
    twice = measured(truth() + 0.5 * 3**0.5 * RNG(5).standard_normal(V.size))
    found = fit_coulomb(twice, offset=True)
    assert found.deviation == pytest.approx(2.0, abs=0.1)
    assert np.std(scaled_residual(found, twice)) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("offset", [0.0, 4.0])
def test_a_fall_with_velocity_is_found_where_there_is_one(offset: float) -> None:
    found = fit_stribeck(measured(truth(static=20.0) + offset), offset=bool(offset))
    assert found["static"] == pytest.approx(20.0, abs=0.5)
    assert found["velocity"] == pytest.approx(0.02, rel=0.1)
    assert found["coulomb"] == pytest.approx(12.0, abs=0.3)
    assert found["viscous"] == pytest.approx(40.0, abs=1.5)
    assert found["offset"] == pytest.approx(offset, abs=0.1)
    assert {n: v.unit for n, v in found.values().items()}["velocity"] == "m/s"


def test_no_fall_is_found_where_there_is_none() -> None:
    for seed in range(5):
        assert fit_stribeck(measured(truth(), seed), offset=True).names == ("coulomb", "viscous", "offset")
    rising = fit_stribeck(measured(truth(static=6.0)), offset=False)  # less at rest: that is no static friction
    assert rising["velocity"] == 0.0


# --- the robust fit


def test_the_robust_deviation_is_the_normal_ones_of_the_median_and_never_nothing() -> None:
    assert regression._robust_scale(np.array([-3.0, 1.0, 2.0, -1.0, 9.0])) == pytest.approx(1.4826 * 2.0)
    assert regression._robust_scale(np.zeros(4)) == 1e-9


def test_hubers_loss_is_square_within_the_knee_and_straight_beyond() -> None:
    """At 1.345 both branches meet, with one slope."""
    k = 1.345
    assert regression._huber_loss(np.array([0.5, -1.0]), 0.5) == pytest.approx(0.5 * 1.0 + k * 2.0 - 0.5 * k * k)
    assert regression._huber_loss(np.array([1.344]), 1.0) == pytest.approx(0.5 * 1.344**2)
    assert regression._huber_loss(np.array([1.346]), 1.0) == pytest.approx(0.5 * 1.346**2, rel=1e-5)


def test_the_fit_of_least_loss_balances_residuals_that_are_clipped_at_the_knee() -> None:
    rng = RNG(3)
    design = rng.standard_normal((200, 2))
    target = design @ [3.0, -2.0] + 0.1 * rng.standard_normal(200)
    target[::9] += 5.0
    theta = regression._minimise_huber_loss(lambda p: design @ p - target, np.zeros(2), np.full(2, -np.inf), 0.2)
    left = design @ theta - target
    assert design.T @ np.clip(left, -0.2, 0.2) == pytest.approx(np.zeros(2), abs=1e-4)
    assert np.abs(left).max() > 4.0


def test_derivatives_are_differences_to_both_sides() -> None:
    found = regression._jacobian(lambda p: np.array([p[0] ** 2, p[0] * p[1], 5.0 * p[1]]), np.array([3.0, 0.0]))
    assert found == pytest.approx(np.array([[6.0, 0.0], [0.0, 3.0], [0.0, 5.0]]), abs=1e-8)


def test_correlation_within_blocks_inflates_and_its_absence_does_not() -> None:
    """Blocks of 5 that are one number each are worth a fifth of the samples; alternating ones no less."""
    one = RNG(4).standard_normal(400)
    assert regression._correlation_inflation(np.repeat(one, 5), np.repeat(np.arange(400), 5)) == pytest.approx(
        5.0, rel=0.15
    )
    assert regression._correlation_inflation(
        RNG(5).standard_normal(2000), np.repeat(np.arange(400), 5)
    ) == pytest.approx(1.0, abs=0.15)
    assert regression._correlation_inflation(np.tile([1.0, -1.0], 200), np.repeat(np.arange(200), 2)) == 1.0
    wild = RNG(6).standard_normal(2000)
    wild[:3] = 1e6  # counted as three deviations
    assert regression._correlation_inflation(wild, np.repeat(np.arange(400), 5)) < 1.3


def law_of(**values: float) -> FrictionFit:
    return FrictionFit(tuple(values), np.array([*values.values()]), np.diag([1.0, 4.0, 0.25, 9.0][: len(values)]), 1.0)


@pytest.mark.parametrize(("static", "falls"), [(10.0, False), (13.3, False), (13.4, True), (20.0, True)])
def test_static_friction_exceeds_coulomb_friction_by_three_standard_errors(static: float, falls: bool) -> None:
    """sqrt(1 + 0.25) apart, whatever viscous friction errs by."""
    assert regression._has_stribeck_effect(law_of(coulomb=10.0, viscous=99.0, static=static)) == falls


def test_the_sandwich_is_of_sums_over_blocks_with_a_correction_for_few() -> None:
    """A mean of 6 blocks of 50: its variance is that of the blocks' sums over the samples squared, times 6 / 5."""
    block, rng = np.repeat(np.arange(6), 50), RNG(7)
    y = 2.0 + 0.3 * rng.standard_normal(6)[block] + rng.standard_normal(300)
    s = samples(np.ones(300), y, block=block)
    found = regression._refine(("offset",), lambda p: p[0] - y, np.array([0.0]), np.array([-np.inf]), s)
    left = y - found.theta[0]
    knee = 1.345 * regression._robust_scale(left)
    clipped, inside = np.clip(left, -knee, knee), np.count_nonzero(np.abs(left) <= knee)
    assert np.sum(clipped) == pytest.approx(0.0, abs=0.05)  # the knee was that of the round before
    sums = np.bincount(block, clipped)
    assert found.covariance[0, 0] == pytest.approx(6 / 5 * float(sums @ sums) / inside**2, rel=1e-6)
    assert found.deviation == pytest.approx(regression._robust_scale(left))


# --- models


def branch(which: Any, level: float, domain: VelocityDomain) -> ModelBranch:
    return ModelBranch(which, lambda v: level * domain.sign(v) + 10.0 * v)


def test_a_model_has_the_force_of_its_branch_and_the_ends_hold_beyond() -> None:
    domain = VelocityDomain(max_velocity=0.2, resolved_velocity=1e-3, nodes=100)
    found = FrictionModel("D", domain, (branch("accelerating", 20.0, domain), branch("slowing", 8.0, domain)))
    v = np.array([-0.5, -0.1, 0.1, 0.5])
    assert found.force(v, True) == pytest.approx([-22.0, -21.0, 21.0, 22.0])
    assert found.force(v, np.array([True, False, True, False])) == pytest.approx([-22.0, -9.0, 21.0, 10.0])
    assert found.branch(accelerating=False).branch == "slowing"
    assert TITLES["A"] == "Stribeck friction"
    assert found.title == TITLES["D"] == "Stribeck friction while speeding up, Coulomb and viscous while slowing"
    one = FrictionModel("A", domain, found.branches[:1])
    assert one.force(v, False) == pytest.approx(one.force(v, True))


def test_a_level_is_held_toward_standstill_with_a_true_sign() -> None:
    domain = VelocityDomain(max_velocity=0.2, resolved_velocity=1e-3, nodes=100)
    found = FrictionModel("A", domain, (branch("both", 20.0, domain),))
    speeds = np.array([-0.1, -1e-9, 0.0, 1e-9, 0.1])
    assert found.level(speeds, accelerating=True)[[0, -1]] == pytest.approx([21.0, 21.0])
    assert np.ptp(found.level(speeds[1:-1], accelerating=True)) == pytest.approx(0.0, abs=1e-9)
    assert found.level(np.zeros(1), accelerating=True)[0] > 19.9


# --- single stick-slips


def slide(speed: list[float], friction: list[float], direction: int = 1, peak: int | None = None) -> StickSlip:
    top = int(np.argmax(speed)) if peak is None else peak
    n = len(speed)
    return StickSlip("r", direction, 0, 0, top, n, n, np.arange(n) * 1.0, np.array(speed), np.array(friction), 1.0)


def test_slides_are_averaged_over_speed_up_to_and_from_their_peak() -> None:
    """Friction 10 + speed while speeding up, 5 + speed while slowing; the second slide has 2 N more."""
    speed, friction = [0.0, 2.0, 4.0, 2.0, 0.0], [10.0, 12.0, 14.0, 7.0, 5.0]
    cuts = [slide(speed, friction), slide(speed, [f + 2.0 for f in friction])]
    up, down = average_stick_slips(cuts)
    assert (up.branch, up.direction, down.branch) == ("accelerating", 1, "slowing")
    assert up.speed == pytest.approx(4.0 * np.arange(1, 61) / 60)
    assert up.friction == pytest.approx(11.0 + up.speed)
    assert down.friction[:30] == pytest.approx(6.0 + down.speed[:30])
    assert up.error == pytest.approx(np.full(60, 2.0**0.5 / 2.0**0.5))
    assert up.count.tolist() == [2] * 60
    assert up.count.size == up.speed.size


def test_a_mean_goes_as_far_as_half_of_the_slides_reach() -> None:
    cuts = [slide([0.0, top, 0.0], [1.0, 1.0 + k, 1.0]) for k, top in enumerate((1.0, 2.0, 9.0))]
    up, _ = average_stick_slips(cuts)
    assert up.speed[-1] == pytest.approx(2.0)
    assert up.count[[0, 29, 31, -1]].tolist() == [3, 3, 2, 2]


def test_a_single_slide_has_no_error_and_each_direction_its_own_mean() -> None:
    forth, back = slide([0.0, 1.0, 0.0], [3.0, 3.0, 3.0]), slide([0.0, 1.0, 0.0], [4.0, 4.0, 4.0], -1)
    found = average_stick_slips([forth, back])
    assert [(a.direction, a.branch) for a in found] == [
        (1, "accelerating"), (1, "slowing"), (-1, "accelerating"), (-1, "slowing"),
    ]  # fmt: skip
    assert [a.friction[0] for a in found] == pytest.approx([3.0, 3.0, 4.0, 4.0])
    assert np.isnan(found[0].error).all()
    assert average_stick_slips([]) == []


def test_a_node_that_no_slide_passes_is_left_out() -> None:
    up, _ = average_stick_slips([slide([0.5, 1.0, 0.0], [3.0, 3.0, 3.0])])
    assert up.speed.min() >= 0.5


# --- imposed motion


def stroked(**given: Any) -> Any:
    """Strokes of 0.1 m/s to and fro, 0.5 s each, friction of 20 N forward and 14 N back, a turn in between."""
    time = 1e-3 * np.arange(8000)
    v = 0.1 * np.where((time % 1.0) < 0.5, 1.0, -1.0)
    v[(np.arange(8000) % 500) < 20] *= 0.3
    friction = np.where(v > 0, 20.0, -14.0) + 0.5 * RNG(1).standard_normal(8000)
    friction[np.abs(v) < 0.05] = 500.0
    recording = given.get("recording", {"p1": np.r_[np.nan, np.full(7999, 3e5)]})
    named = type("Recorded", (dict,), {"name": "stroke"})(recording)
    known = {"v": v, "time": time, "sliding": lambda margin: np.abs(v) > 0.0, "block_length": 0.2, "recording": named}
    return SimpleNamespace(**{**known, "friction": lambda mass: friction + mass, **given, "recording": named})


def test_kinetic_friction_is_half_the_difference_of_both_directions() -> None:
    found = kinetic_friction(stroked(), 0.0)
    assert found is not None
    assert found.forward.value == pytest.approx(20.0, abs=0.1)
    assert found.backward.value == pytest.approx(-14.0, abs=0.1)
    assert found.friction.value == pytest.approx(0.5 * (found.forward.value - found.backward.value))
    assert found.offset.value == pytest.approx(0.5 * (found.forward.value + found.backward.value))
    assert found.speed == pytest.approx(0.1)
    assert found.recording == "stroke"
    assert found.pressures == {"p1": 3e5}
    assert found.friction.unit == "N"
    halves = [v.high - v.value for v in (found.forward, found.backward, found.friction, found.offset)]
    assert [v.value - v.low for v in (found.forward, found.backward)] == pytest.approx(halves[:2])
    assert halves[2] == pytest.approx(np.hypot(*halves[:2]) / 2)
    assert halves[2] == pytest.approx(halves[3])
    # the median of 3840 normal numbers: 1.25 / sqrt(3840) of their deviation
    assert halves[0] == pytest.approx(Z95 * 1.25 * 0.5 / 3840**0.5, rel=0.5)


def test_the_mass_goes_into_the_friction_force() -> None:
    heavier = kinetic_friction(stroked(), 3.0)
    assert heavier is not None
    assert heavier.offset.value == pytest.approx(3.0 + 3.0, abs=0.1)


def test_motion_in_one_direction_or_none_gives_no_kinetic_friction() -> None:
    one_way = stroked()
    one_way.v = np.abs(one_way.v)
    assert kinetic_friction(one_way, 0.0) is None
    still = stroked()
    still.sliding = lambda margin: np.zeros(8000, bool)
    assert kinetic_friction(still, 0.0) is None


# --- velocities


TIME = 1e-3 * np.arange(3000)


def test_what_gathers_between_two_rests_is_taken_away_as_a_line() -> None:
    rest = (TIME < 0.5) | (TIME > 2.5)
    a = np.where((TIME >= 1.0) & (TIME < 1.5), 2.0, 0.0) - np.where((TIME >= 1.5) & (TIME < 2.0), 2.0, 0.0) + 0.3
    v = integrate_between_rests(TIME, a, rest)
    assert np.abs(v[rest]).max() < 1e-12
    assert v[1500] == pytest.approx(1.0, abs=5e-3)
    assert v[2200] == pytest.approx(0.0, abs=5e-3)


def test_position_and_acceleration_together_give_the_velocity_and_the_bias() -> None:
    v = 0.3 * np.sin(2 * np.pi * TIME)
    x, a = np.concatenate([[0.0], np.cumsum(0.5e-3 * (v[1:] + v[:-1]))]), np.gradient(v, TIME)
    read_x, read_a = x + 1e-6 * RNG(1).standard_normal(3000), a + 0.7 + 0.05 * RNG(2).standard_normal(3000)
    found, bias = fuse_position_and_acceleration(TIME, a, 1e-6, 0.05)(read_x, read_a)
    assert bias == pytest.approx(0.7, abs=0.02)
    assert np.std(found - v) < 5e-4


def test_an_acceleration_lasts_for_half_the_time_in_which_its_covariance_halves_less_the_noise() -> None:
    """Levels held for 200 samples: the covariance falls as a triangle, to its half at 100."""
    held = np.repeat(RNG(3).choice([-1.0, 1.0], 400), 200)
    assert correlation_samples(held + 0.5 * RNG(4).standard_normal(held.size), NoiseModel(0.5)) == pytest.approx(
        50, abs=6
    )
    assert correlation_samples(RNG(5).standard_normal(2000), NoiseModel(1e-3)) == MIN_REST_SAMPLES
    assert correlation_samples(np.zeros(50), NoiseModel(1.0)) == MIN_REST_SAMPLES


def pulses(*at: float) -> np.ndarray:
    """Slides: speeding up and slowing for 0.1 s each, that end at rest."""
    since = [TIME - t for t in at]
    return np.sum([3.0 * ((q >= 0) & (q < 0.1)) - 3.0 * ((q >= 0.1) & (q < 0.2)) for q in since], axis=0)


def test_between_slides_the_piston_rests() -> None:
    noise = NoiseModel(0.05)
    found = rest_mask(TIME, pulses(0.8, 2.0) + 0.2 + 0.05 * RNG(1).standard_normal(3000), noise)
    assert found[(TIME > 0.1) & (TIME < 0.75)].mean() > 0.95
    assert found[(TIME > 1.1) & (TIME < 1.9)].mean() > 0.95
    assert found[(TIME > 2.3)].mean() > 0.95
    assert not found[(TIME > 0.8) & (TIME < 1.0)].any()


def test_steady_sliding_is_no_rest() -> None:
    a = np.where((TIME >= 0.8) & (TIME < 0.9), 3.0, 0.0) - np.where((TIME >= 2.0) & (TIME < 2.1), 3.0, 0.0)
    found = rest_mask(TIME, a + 0.05 * RNG(1).standard_normal(3000), NoiseModel(0.05))
    assert not found[(TIME > 0.95) & (TIME < 1.95)].any()
    assert found[(TIME > 2.2)].mean() > 0.95
