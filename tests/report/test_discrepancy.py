"""What no effect accounts for: told in words, and drawn over the signal of which it is a function."""

from __future__ import annotations

from typing import Any

import numpy as np

from pneucli.messages import verdict
from pneucli.report.report_data import Table
from pneucli.report.sections.diagnosis import _smooth_terms

REST: dict[str, Any] = {
    "subsystem": "mechanics", "channel": "force", "times_noise": 12.83, "variable": "x", "share": 0.95,
    "character": "a force, a function of piston position", "law": "a parabola", "also_over": ["p1", "p2"],
}  # fmt: skip


def test_a_discrepancy_has_its_location_and_its_variable() -> None:
    assert verdict.discrepancy_character(REST) == (
        "a force, a function of piston position (a parabola), or of pressure of chamber 1, or of pressure of chamber 2"
    )
    assert verdict.discrepancy_location(REST) == "force errs by 13 times its noise (mechanics)"
    assert verdict.explaining_signal(REST) == (
        "A function of x explains 95 % of what is left in recordings that were left out."
    )


def test_of_many_other_signals_the_first_are_named() -> None:
    """Where it is a function of nearly every signal, their list tells nothing."""
    rest = REST | {"also_over": ["p1", "p2", "v", "a"]}
    assert verdict.discrepancy_character(rest).endswith(
        "(a parabola), or of pressure of chamber 1, or of pressure of chamber 2, or of 2 other signals"
    )
    one_more = REST | {"also_over": ["p1", "p2", "v"]}
    assert verdict.discrepancy_character(one_more).endswith("or of piston velocity")


def test_a_period_is_stated_only_for_fitted_recordings() -> None:
    """It is found in all recordings at once."""
    rest = REST | {"variable": "time", "law": "a sine", "also_over": []}
    assert verdict.explaining_signal(rest) == "The period explains 95 % of what is left."


def test_a_discrepancy_without_a_shape_has_no_explaining_signal() -> None:
    rest = REST | {"variable": None, "share": None, "law": None, "also_over": [], "character": "without a shape"}
    assert verdict.discrepancy_character(rest) == "without a shape"
    assert verdict.explaining_signal(rest) == ""


def test_the_smooth_term_is_drawn_over_its_signal() -> None:
    texts = {"channel": "force", "acts_as": "dry friction", "variable": "p1", "unit": "N"}
    columns = {name: [text] * 60 for name, text in texts.items()}
    (figure,) = _smooth_terms(Table(columns | {"value": np.linspace(1e5, 5e5, 60), "law": np.linspace(-2.0, 2.0, 60)}))
    assert "pressure of chamber 1 in bar" in figure.svg
    assert "dry friction in N" in figure.svg
    assert "part of force that no effect" in figure.caption


def test_without_data_there_is_no_figure() -> None:
    assert _smooth_terms(Table({})) == []
