"""What people look up of friction, on motions whose answer is written down beforehand."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pneucli.figure import Figure
from pneucli.identify.friction.identification import KineticFriction, break_away, pressure_dependence, repeatability
from pneucli.identify.friction.kinematics import Motion

AMBIENT = 1e5


def level(name: str, friction: float, bar: float | None = None, speed: float = 0.01) -> KineticFriction:
    value = Figure(friction, friction - 0.1, friction + 0.1, "N")
    pressures = {} if bar is None else {"p1": AMBIENT + bar * 1e5}
    return KineticFriction(name, pressures, speed, value, value, value, value)


def motion(v: np.ndarray, drive: np.ndarray, imposed: bool, contact: np.ndarray | None = None) -> Motion:
    named = SimpleNamespace(name="one")
    fields = {"recording": named, "v": v, "drive": drive, "smooth_drive": drive, "rest_speed": 0.1, "imposed": imposed}
    fields |= {"smooth_a": np.gradient(v), "contact": np.zeros(v.size, dtype=bool) if contact is None else contact}
    return cast("Motion", SimpleNamespace(**fields))


def test_friction_grows_along_a_line_over_pressure() -> None:
    line = pressure_dependence([level(str(bar), 3.0 + 0.5 * bar, bar) for bar in (1, 3, 5)], AMBIENT)
    assert line is not None
    assert (line.at_ambient.value, line.slope.value) == pytest.approx((3.0, 0.5e-5))
    assert (line.at_ambient.unit, line.slope.unit) == ("N", "N/Pa")
    bent = pressure_dependence([level("a", 3.0, 1), level("b", 5.0, 3), level("c", 4.0, 5)], AMBIENT)
    assert bent is not None
    assert bent.slope.low < 0.25e-5 < bent.slope.high


@pytest.mark.parametrize("bars", [(1, 5), (3, 3, 3), (None, None, None)])
def test_no_line_through_two_points_or_one_pressure(bars: tuple[Any, ...]) -> None:
    assert pressure_dependence([level(str(i), 3.0, bar) for i, bar in enumerate(bars)], AMBIENT) is None


def test_recordings_at_one_pressure_and_speed_are_repeats() -> None:
    given = [level("a", 4.0, 1.0), level("b", 5.0, 1.05), level("c", 7.0, 5.0), level("d", 9.0, 1.0, speed=0.1)]
    (found,) = repeatability(given, AMBIENT)
    assert found.recordings == ["a", "b"]
    assert (found.friction, found.spread) == pytest.approx((4.5, np.std([4.0, 5.0], ddof=1) / 4.5))


def test_a_free_piston_breaks_away_at_the_force_that_it_held_last() -> None:
    rest, slide = np.zeros(20), np.ones(20)
    v = np.concatenate([rest, slide, rest, -slide])
    drive = np.concatenate([np.linspace(0, 8, 20), np.full(20, 5.0), np.linspace(5, -10, 20), np.full(20, -5.0)])
    found = break_away(motion(v, drive, imposed=False))
    assert found is not None
    assert (found.count, found.least, found.most) == (2, pytest.approx(8.0, abs=0.5), pytest.approx(10.0, abs=1.0))


@pytest.mark.parametrize("imposed", [False, True])
def test_leaving_a_stop_is_no_break_away(imposed: bool) -> None:
    """Up to 18 N leave it on its stop, 10 N break it away elsewhere."""
    rest, slide = np.zeros(20), np.ones(100)
    v = np.concatenate([rest, slide, rest, -slide])
    pull = np.linspace(0, 18, 20), np.full(100, 5.0), np.linspace(5, -10, 20), np.full(100, -5.0)
    found = break_away(motion(v, np.concatenate(pull), imposed=imposed, contact=np.arange(v.size) < 20))
    assert found is not None
    assert found.most == pytest.approx(10.0, abs=1.0)


def test_a_machine_finds_the_break_away_at_the_start_of_its_stroke() -> None:
    v = np.concatenate([np.zeros(10), np.ones(100), np.zeros(10), -np.ones(100), np.zeros(10)])
    pull = np.full(100, 5.0)
    pull[3] = 9.0
    late = np.full(100, 5.0)
    late[4], late[60] = 7.0, 30.0  # what comes later in a stroke is no break-away
    drive = np.concatenate([np.zeros(10), pull, np.zeros(10), -late, np.zeros(10)])
    found = break_away(motion(v, drive, imposed=True))
    assert found is not None
    assert (found.count, found.least, found.most) == (2, 7.0, 9.0)


def test_a_fault_of_the_position_of_a_few_samples_makes_no_second_stroke() -> None:
    """Back and forth for two samples each, as a laser that loses its spot, and at once after the turn."""
    v = np.concatenate([np.zeros(10), np.ones(100), np.zeros(1), -np.ones(100), np.zeros(10)])
    for k in (60, 66, 112, 180):
        v[k : k + 2] *= -1.0
    drive = np.where(np.arange(v.size) < 110, 5.0, -7.0)
    found = break_away(motion(v, drive, imposed=True))
    assert found is not None
    assert (found.count, found.least, found.most) == (2, 5.0, 7.0)


def test_what_a_machine_accelerates_is_no_friction_that_breaks_away() -> None:
    """95 kg that it starts with 1 m/s^2, against 20 N of dry friction."""
    v = np.concatenate([np.zeros(10), np.linspace(0.0, 5.0, 50), np.full(200, 5.0), np.zeros(10)])
    moved = motion(v, 20.0 * np.sign(v) + 95.0 * np.gradient(v), imposed=True)
    found, pushed = break_away(moved, 95.0), break_away(moved)
    assert found is not None
    assert pushed is not None
    assert found.force.value == pytest.approx(20.0)
    assert pushed.force.value > 25.0


def test_a_piston_that_never_rests_has_no_break_away() -> None:
    assert break_away(motion(np.ones(50), np.ones(50), imposed=False)) is None
