"""What no effect accounts for: told in words, and drawn over the signal of which it is a function."""

from __future__ import annotations

import numpy as np

from pneucli.report.report_data import Table
from pneucli.report.sections.diagnosis import _smooth_terms


def test_the_smooth_term_is_drawn_over_its_signal() -> None:
    texts = {"channel": "force", "acts_as": "dry friction", "variable": "p1", "unit": "N"}
    columns = {name: [text] * 60 for name, text in texts.items()}
    (figure,) = _smooth_terms(Table(columns | {"value": np.linspace(1e5, 5e5, 60), "law": np.linspace(-2.0, 2.0, 60)}))
    assert "pressure of chamber 1 in bar" in figure.svg
    assert "dry friction in N" in figure.svg
    assert "part of force that no effect" in figure.caption


def test_without_data_there_is_no_figure() -> None:
    assert _smooth_terms(Table({})) == []
