"""The draw: varied within the machine time, safe manoeuvres only, the same for the same seed, some held out."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pneucli.plan.bench import Manoeuvre, Outcome, described_benches, duration_of, hold, ramp, sample, sine
from pneucli.plan.limits import Limits, limits_of, violations
from pneucli.plan.manoeuvres import candidate_manoeuvres, cost_of, draw_programme, manual_manoeuvres
from pneucli.recording import Rig

RIG = Rig(supply_pressure=7e5, piston_area_1=8e-4, stroke=0.2, moving_mass=2.0, vessel_volume=160e-6)
BENCHES = described_benches(RIG)
LIMITS = limits_of(RIG, BENCHES)
LISTED = [m for b in BENCHES for m in candidate_manoeuvres(b, LIMITS)]
BY_HAND = [m for b in BENCHES for m in manual_manoeuvres(b, LIMITS) if m.kind == "known-force"]


def draw(
    seconds: float, seed: int = 1, listed: Sequence[Manoeuvre] = LISTED, by_hand: Sequence[Manoeuvre] = ()
) -> list[Manoeuvre]:
    return draw_programme(listed, seconds, lambda _: True, seed, by_hand)


def told(programme: list[Manoeuvre]) -> list[tuple[object, ...]]:
    return [(m.bench.drive, m.kind, m.profile, m.use) for m in programme]


@pytest.mark.parametrize("seconds", [15.0, 60.0, 300.0])
def test_the_machine_time_is_kept_changes_included_and_used(seconds: float) -> None:
    programme = draw(seconds)
    spent, drawn = sum(map(cost_of, programme)), {m.profile for m in programme}
    assert spent <= seconds < spent + min(cost_of(m) for m in LISTED if m.profile not in drawn)


def test_a_seed_gives_one_programme_and_another_seed_another() -> None:
    assert told(draw(60.0)) == told(draw(60.0)) != told(draw(60.0, seed=2))


def test_benches_take_turns_and_no_kind_comes_again_before_every_other() -> None:
    alike = [replace(m, profile=(hold(m.bench.middle, 5.0),)) for m in LISTED]  # each takes 7 s: none is passed over
    for count in (3, 6, 12):
        programme = draw(7.0 * count, listed=alike)
        assert len({(m.bench.setup, m.kind) for m in programme}) == len(programme) == count
        assert abs(sum(1 if m.bench.name == "vessel" else -1 for m in programme)) == count % 2
    assert {(m.bench.setup, m.kind) for m in draw(7.0 * 16, listed=alike)} == {(m.bench.setup, m.kind) for m in LISTED}


def test_a_kind_does_not_come_again_before_the_same_kind_with_another_setup() -> None:
    loop = next(b for b in BENCHES if b.drive == "position")
    benches = [replace(loop, template=replace(loop.template, chamber_2=how)) for how in ("closed", "open")]
    sines = [m for b in benches for m in candidate_manoeuvres(b, LIMITS) if m.kind == "motion-sine"]
    alike = [replace(m, profile=(hold(0.1, 5.0),)) for m in sines]
    for seed in range(8):
        assert [m.bench.template.chamber_2 for m in draw(14.0, seed, alike)] == ["closed", "open"]


def test_kinds_come_again_with_other_levels_speeds_or_places_and_nothing_twice() -> None:
    programme = draw(1e4)
    assert len(programme) == len(LISTED)
    assert {id(m.profile) for m in programme} == {id(m.profile) for m in LISTED}


def test_a_manoeuvre_that_is_not_safe_is_not_drawn() -> None:
    asked: list[str] = []

    def is_safe(m: Manoeuvre) -> bool:
        asked.append(m.kind)
        return m.kind != "steps"

    programme = draw_programme(LISTED, 60.0, is_safe, 1)
    assert "steps" in asked
    assert "steps" not in {m.kind for m in programme}


def test_a_third_of_each_bench_is_held_out() -> None:
    for seconds in (60.0, 300.0):
        for bench in ("vessel", "cylinder"):
            uses = Counter(m.use for m in draw(seconds) if m.bench.name == bench)
            assert uses["test"] == (uses.total() + 1) // 3


def test_what_stands_alone_is_repeated_to_be_held_out_where_time_is_left() -> None:
    alone = LISTED[:1]
    assert [m.use for m in draw(30.0, listed=alone)] == ["train", "test"]
    assert [m.use for m in draw(cost_of(alone[0]), listed=alone)] == ["train"]


def test_recordings_of_one_setup_follow_each_other_those_by_hand_last_and_fitted() -> None:
    programme = draw(300.0, by_hand=BY_HAND)
    setups = [m.bench.setup for m in programme]
    assert [one for one, after in pairwise([*setups, None]) if one != after] == [b.setup for b in BENCHES]
    last = [m for m in programme if m.bench.drive == "position"][-2:]
    assert [(m.kind, m.use) for m in last] == [("known-force", "train")] * 2
    assert sum(map(cost_of, programme)) <= 300.0


# --- commands as segments: values at their ends, the rise of a sine, sampling across segments


def test_a_sine_begins_and_ends_at_its_centre_without_a_jump():
    wave = sine(0.1, 0.02, 2.0, 5.0)
    values = sample((wave,), 1e-3)
    assert values[0] == 0.1
    assert abs(values[-1] - 0.1) < 1e-4
    assert np.abs(np.diff(values)).max() <= 0.02 * 2.0 * np.pi * 2.0 * 1e-3 * 1.05


def test_a_sine_reaches_its_amplitude_after_one_period():
    wave = sine(0.0, 1.0, 2.0, 5.0)
    assert wave.rise == 0.5
    assert np.abs(sample((wave,), 1e-3)[500:4500]).max() == pytest.approx(1.0, abs=1e-3)


def test_segments_follow_each_other_at_their_times():
    profile = (hold(1.0, 0.5), ramp(1.0, 3.0, 1.0), hold(3.0, 0.25))
    values = sample(profile, 0.25)
    assert duration_of(profile) == 1.75
    assert values.tolist() == [1.0, 1.0, 1.0, 1.5, 2.0, 2.5, 3.0]


# --- limits of a rig: defaults, stated ones, and what exceeds them


LIMITS_RIG = Rig(supply_pressure=7e5, ambient_pressure=1e5, piston_area_1=8e-4, stroke=0.2, moving_mass=2.0)
REST = Outcome(
    np.arange(3.0),
    {},
    p1=np.full(3, 3e5),
    p2=np.full(3, 3e5),
    x=np.full(3, 0.1),
    v=np.zeros(3),
)


def test_limits_follow_from_the_rig_where_the_file_states_none():
    limits = limits_of(LIMITS_RIG, described_benches(LIMITS_RIG))
    assert limits.position == pytest.approx((0.01, 0.19))
    assert limits.max_pressure == pytest.approx(1.15 * 7e5)
    assert limits.max_force == pytest.approx(1.1 * 6e5 * 8e-4)


def test_stated_limits_replace_the_defaults():
    limits = limits_of(
        LIMITS_RIG, described_benches(LIMITS_RIG), {"end_margin": 0.05, "max_speed": 0.2, "max_air": 1e-3}
    )
    assert limits.position == pytest.approx((0.05, 0.15))
    assert limits.max_speed == 0.2
    assert limits.max_air == pytest.approx(1.185e-3)


@pytest.mark.parametrize(
    ("change", "quantity"),
    [
        ({"x": np.array([0.1, 0.195, 0.1])}, "x"),
        ({"x": np.array([0.1, 0.004, 0.1])}, "x"),
        ({"v": np.array([0.0, -1.7, 0.0])}, "v"),
        ({"p1": np.array([3e5, 9e5, 3e5])}, "p1"),
        ({"p2": np.array([3e5, 9e5, 3e5])}, "p2"),
        ({"p1": np.array([3e5, 7.9e5, 3e5]), "p2": np.full(3, 1e5)}, "force"),
        ({"p1": np.array([3e5, np.nan, 3e5])}, "p1"),
        ({"air": 1.0}, "air"),
    ],
)
def test_each_limit_is_checked(change: dict, quantity: str):
    limits = replace(limits_of(LIMITS_RIG, described_benches(LIMITS_RIG)), max_air=0.5)
    assert violations(REST, limits, LIMITS_RIG) == []
    assert quantity in {v.quantity for v in violations(replace(REST, **change), limits, LIMITS_RIG)}


def test_a_pressure_that_no_bench_can_make_is_refused():
    impossible = replace(REST, p1=np.array([3e5, 0.5e5, 3e5]), lowest_pressure=0.97e5)
    assert [v.quantity for v in violations(impossible, Limits(), LIMITS_RIG)] == ["p1"]
