"""The choice: the most telling manoeuvre for its time, within the machine time, safe ones only, one held out."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.plan.bench import described_benches
from pneucli.plan.information import Information
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.profile import hold
from pneucli.plan.selection import (
    CHANGE_OVER_TIME,
    Evaluated,
    choose_sequence,
    entropy_objective,
    grouped_by_setup,
    total_information,
    width_objective,
)
from pneucli.recording import Rig

BENCHES = described_benches(Rig(supply_pressure=7e5, piston_area_1=8e-4, stroke=0.2, moving_mass=2.0))
BENCH = BENCHES[0]
NOTHING_KNOWN = np.zeros((0, 0))


def candidate(level: float, gram: np.ndarray, duration: float = 5.0) -> Evaluated:
    manoeuvre = Manoeuvre("motion-sine", BENCH, (hold(0.1, duration),), level=level)
    return Evaluated(manoeuvre, Information(gram, gram.shape[0], np.sqrt(np.diag(gram))))


FIRST = candidate(1.0, np.diag([50.0, 0.0]))
SECOND = candidate(2.0, np.diag([0.0, 50.0]))
WEAK = candidate(3.0, np.diag([0.5, 0.5]))
OBJECTIVE = entropy_objective([1.0, 1.0, 1.0], [0.1, 0.1], NOTHING_KNOWN)


def test_manoeuvres_that_show_different_effects_are_combined_and_one_is_held_out():
    chosen = choose_sequence([WEAK, FIRST, SECOND], OBJECTIVE, 60.0, lambda _: True)
    fitted = [c.manoeuvre.level for c in chosen if c.manoeuvre.use == "train"]
    assert set(fitted[:2]) == {1.0, 2.0}
    assert [c.manoeuvre.use for c in chosen].count("test") == 1
    assert chosen[-1].manoeuvre.use == "test"
    assert total_information(chosen).matrix[0, 0] >= 50.0


def test_the_machine_time_is_kept_changes_included():
    chosen = choose_sequence([WEAK, FIRST, SECOND], OBJECTIVE, 15.0, lambda _: True)
    assert sum(c.manoeuvre.duration + CHANGE_OVER_TIME for c in chosen) <= 15.0
    assert len(chosen) == 2


def test_held_out_recordings_show_every_effect_that_the_fitted_ones_show():
    again = [candidate(4.0, np.diag([50.0, 0.0])), candidate(5.0, np.diag([0.0, 50.0])), candidate(6.0, np.eye(2))]
    chosen = choose_sequence([FIRST, SECOND, *again], OBJECTIVE, 60.0, lambda _: True)
    tests = [c for c in chosen if c.manoeuvre.use == "test"]
    shown = sum((c.information.matrix for c in tests), np.zeros((2, 2)))
    assert np.diag(shown).min() >= 50.0
    assert len({c.manoeuvre.level for c in chosen}) == len(chosen)  # no repetition where there are others


def test_an_unsafe_manoeuvre_is_never_chosen_not_even_to_be_held_out():
    chosen = choose_sequence([WEAK, FIRST, SECOND], OBJECTIVE, 60.0, lambda m: m.level != 1.0)
    assert {c.manoeuvre.level for c in chosen} <= {2.0, 3.0}


def test_of_two_that_tell_the_same_the_shorter_one_is_chosen():
    short, long = candidate(4.0, np.diag([9.0, 9.0]), 3.0), candidate(5.0, np.diag([9.0, 9.0]), 12.0)
    chosen = choose_sequence([long, short], OBJECTIVE, 30.0, lambda _: True)
    assert chosen[0].manoeuvre.level == 4.0


def test_a_parameter_is_narrowed_by_what_shows_it():
    def parameter_candidate(level: float, curvature: np.ndarray) -> Evaluated:
        return Evaluated(candidate(level, np.zeros((1, 1))).manoeuvre, Information(curvature, 0, np.zeros(0)))

    shows, hides = parameter_candidate(1.0, np.diag([99.0, 0.0])), parameter_candidate(2.0, np.diag([0.0, 99.0]))
    objective = width_objective(np.eye(2), [0])
    assert choose_sequence([hides, shows], objective, 20.0, lambda _: True)[0].manoeuvre.level == 1.0
    assert objective(shows.information) == pytest.approx(-1.0)  # a variance of 1 / (1 + 99)


def test_recordings_of_one_setup_follow_each_other():
    at_the_valve = Evaluated(Manoeuvre("pulses", BENCHES[1], (hold(0.0, 5.0),), level=3.0), FIRST.information)
    mixed = choose_sequence([FIRST, at_the_valve, SECOND], OBJECTIVE, 60.0, lambda _: True, least=3)
    assert {c.manoeuvre.bench.drive for c in mixed} == {"position", "valve"}
    ordered = grouped_by_setup(mixed, BENCHES)
    drives = [c.manoeuvre.bench.drive for c in ordered]
    assert drives == sorted(drives)  # the position loop before the valve, as the benches are listed
    assert len(ordered) == len(mixed)
