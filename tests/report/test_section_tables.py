"""The tables of the page as data."""

from __future__ import annotations

import numpy as np

from pneucli.report.page_elements import Cell, Grid, Note, Section, section_tables


def test_columns_of_numbers_are_numbers_and_others_are_text() -> None:
    rows = [
        [Cell("best", numeric=False), Cell("1.5"), "2·10⁻³", "holds"],
        [Cell("pid", numeric=False), Cell("–"), "−4", "∞"],
    ]
    section = Section("bench", "Bench", "", [Note("a note"), Grid("Errors.", ("law", "rest", "load", "so"), rows)])
    (table,) = section_tables([section])
    assert (table.name, table.caption) == ("bench-1", "Errors.")
    assert table.columns["law"] == ["best", "pid"]
    assert np.allclose(table.columns["rest"], [1.5, np.nan], equal_nan=True)
    assert np.allclose(table.columns["load"], [2e-3, -4.0])
    assert table.columns["so"] == ["holds", "∞"]


def test_repeated_and_empty_titles_get_distinct_names_and_empty_tables_none() -> None:
    grids = [Grid("", ("x", "x", ""), [["1", "2", "3"]]), Grid("", ("y",), [])]
    (table,) = section_tables([Section("s", "S", "", grids)])
    assert list(table.columns) == ["x (1)", "x (2)", "column 3"]
