"""Proposed experiments, in words."""

from __future__ import annotations

from pneucli.messages import diagnose as words


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
