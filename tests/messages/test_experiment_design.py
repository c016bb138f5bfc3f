"""Proposed experiments, in words."""

from __future__ import annotations

from typing import get_args

import pytest

from pneucli.diagnose.experiment_design import ManoeuvreKind
from pneucli.messages import experiment_design as words


def test_every_manoeuvre_has_its_words() -> None:
    assert set(words.MANOEUVRES) == set(get_args(ManoeuvreKind))


@pytest.mark.parametrize(
    ("manoeuvre", "text"),
    [
        (("charge-and-hold", 5.0), "charge with 5 V for 2 s, shut the valve and hold for 30 s"),
        (("stairs", 4.0), "stairs of 0.4 to 1.2 V, up and down, 1 s each"),
        (("command-sine", 2.5, 0.5, "vessel"), "a sine of 2.5 V at 0.5 Hz (vessel)"),
        (("pressure-sine", None, 4.0), "a sine of the pressure difference at 4 Hz and 4 bar (absolute)"),
    ],
)
def test_a_manoeuvre_states_its_numbers_and_its_bench(manoeuvre: tuple[str, float], text: str) -> None:
    assert words.manoeuvre_text(*manoeuvre) == text


def test_the_procedures_of_two_effects_are_joined_and_a_common_one_stands_once() -> None:
    names = ("a", "b")
    assert words.distinguishing_experiment(names, ("Do this.", "Do that.")) == "To tell a from b: Do this. Do that."
    assert words.distinguishing_experiment(names, ("Do this.", "Do this.")) == "To tell a from b: Do this."


def test_no_separating_manoeuvre_is_stated() -> None:
    assert "by more than noise" in words.discriminating_manoeuvre(None)
    assert "p1 differs by 12 times its noise" in words.discriminating_manoeuvre("a sine", "p1", 12.3)


def test_a_discrepancy_names_the_procedures_of_effects_that_may_be_it_and_the_signal_to_vary() -> None:
    text = words.discrepancy_experiment([("stribeck", "Move slowly.")], "force", "mechanics", "x")
    assert text.startswith("To test stribeck: Move slowly. The discrepancy is in force (mechanics).")
    assert "another range or order of x" in text
    assert "order of each signal" in words.discrepancy_experiment([], "p1", "gas", None)
