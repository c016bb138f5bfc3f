"""The area between the knots of a valve, and the commands at which two valves with the same knots may differ."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from pneucli.simulate.valve_forms import TABLE_POINTS, LinearValve, SwitchingValve, ValveArea

COMMANDS = (-9.0, -6.0, -4.0, -2.0, -1.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0)
AREAS = (2e-6, 1.4e-6, 9e-7, 4e-7, 1e-7, 1.2e-7, 5e-7, 7e-7, 1.2e-6, 1.5e-6, 2.1e-6)
VALVE = ValveArea(COMMANDS, AREAS, 0.4, 0.3)
U = np.linspace(-12.0, 12.0, 4801)


@given(knot=st.integers(0, len(COMMANDS) - 1), factor=st.sampled_from((0.6, 0.95, 1.05, 1.7)))
def test_a_moved_knot_changes_nothing_outside_the_changed_range(knot: int, factor: float) -> None:
    moved = replace(VALVE, areas=tuple(a * factor if i == knot else a for i, a in enumerate(AREAS)))
    ((low, high),) = VALVE.changed_ranges(moved)
    outside = (low > U) | (high < U)
    assert moved(U[outside]) == pytest.approx(VALVE(U[outside]), rel=1e-12, abs=0.0)  # one unit in the last place
    assert low <= COMMANDS[knot] <= high
    assert moved(U[~outside]) != pytest.approx(VALVE(U[~outside]), rel=1e-3, abs=0.0)


def test_an_inner_knot_influences_up_to_its_second_neighbours() -> None:
    moved = replace(VALVE, areas=(*AREAS[:7], 7.7e-7, *AREAS[8:]))  # at 3 V
    assert VALVE.changed_ranges(moved) == ((1.0, 7.0),)
    mirrored = replace(VALVE, areas=(*AREAS[:2], 1e-6, *AREAS[3:]))  # at -4 V
    assert VALVE.changed_ranges(mirrored) == ((-9.0, -1.0),)
    last = replace(VALVE, areas=(*AREAS[:-1], 2.2e-6))  # at 10 V, and the power law beyond
    assert VALVE.changed_ranges(last) == ((5.0, np.inf),)


def test_an_overlap_changes_the_whole_of_its_direction() -> None:
    assert VALVE.changed_ranges(replace(VALVE, overlap_fill=0.5)) == ((0.0, np.inf),)
    assert VALVE.changed_ranges(replace(VALVE, overlap_vent=0.5)) == ((-np.inf, 0.0),)
    assert VALVE.changed_ranges(VALVE) == ()


def test_a_table_holds_the_area_at_its_points() -> None:
    u = np.linspace(-8.0, 8.0, TABLE_POINTS)
    assert VALVE.table(8.0) == pytest.approx(VALVE(u), rel=1e-12, abs=1e-20)
    assert VALVE.table(8.0)[TABLE_POINTS // 2] == 0.0


def test_other_forms_report_their_changed_directions() -> None:
    line, pair = LinearValve(2e-7, 10.0), SwitchingValve(2e-6, 1e-6, 24.0)
    assert line.changed_ranges(line.scaled(1.1)) == ((-np.inf, np.inf),)
    assert line.changed_ranges(line) == ()
    assert pair.changed_ranges(replace(pair, fill=3e-6)) == ((0.0, np.inf),)
    assert pair.changed_ranges(replace(pair, vent=3e-6)) == ((-np.inf, 0.0),)
    assert pair.changed_ranges(pair) == ()


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=8), st.floats(0.0, 0.5))
def test_the_area_follows_the_monotone_cubic_of_scipy(steps: list[float], overlap: float) -> None:
    commands, areas = 1.0 + np.arange(len(steps)), 1e-7 * np.exp(np.cumsum(steps))
    valve = ValveArea(tuple(commands), tuple(areas), overlap_fill=overlap)
    cubic = PchipInterpolator(np.log(commands - overlap), np.log(areas))
    u = np.linspace(commands[0], commands[-1], 101)
    assert valve(u) == pytest.approx(np.exp(cubic(np.log(u - overlap))), rel=1e-9)
