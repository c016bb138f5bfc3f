"""The chapters on the controllers side by side, here and in the report of the thesis."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pneucli.report import ReportData, Table
from pneucli.report.sections import SECTIONS
from pneucli.report.sections.law_comparison import section as law_comparison
from pneucli.report.thesis.control import section as thesis_control
from pneucli.report.thesis.valve import section as thesis_figures
from tests.report import controlled

TIME = 1e-2 * np.arange(600)


def runs(*names: str) -> Table:
    """Steps, a load, and a pressure that is asked for, under each of the controllers."""
    columns: dict[str, list[Any]] = {"scenario": [], "controller": []}
    numbers: dict[str, list[Any]] = {}
    for name in names:
        for scenario in ("steps", "load", "pressure"):
            reference = np.where(TIME < 2.0, 0.1, 0.13) if scenario != "pressure" else np.full(TIME.size, np.nan)
            asked = np.where(TIME < 2.0, 3e5, 3.5e5)
            parts = {
                "time": TIME,
                "x_ref": reference,
                "x": np.full(TIME.size, 0.12),
                "p1": asked - 1e3,
                "p1_ref": asked,
            }
            parts |= {"u": np.sin(TIME), "flow_estimate": np.cos(TIME), "load_estimate": 0.1 * TIME}
            parts |= {"load": np.where(TIME > 3.0, -50.0, 0.0) * (scenario == "load")}
            columns["scenario"] += [scenario] * TIME.size
            columns["controller"] += [name] * TIME.size
            for key, part in parts.items():
                numbers.setdefault(key, []).append(part)
    return Table({**columns, **{key: np.concatenate(parts) for key, parts in numbers.items()}})


@pytest.fixture(scope="module")
def material() -> ReportData:
    names = ("best", "pdc", "pid", "compensated", "compensated, no map")
    return ReportData("demo", {"design": controlled.design()}, {"design/comparison_signals": runs(*names)})


def test_a_poor_control_law_is_named_with_its_figures(material: ReportData) -> None:
    told = [part.text for part in law_comparison(material).parts if part.kind == "note"]
    assert any("pdc stays up to 7.8 mm off" in text and "best" not in text for text in told)
    assert any("sector" in text for text in told)  # could not be made


def test_the_laws_the_map_and_the_components_have_a_table_each(material: ReportData) -> None:
    grids = [part for part in law_comparison(material).parts if part.kind == "grid"]
    names = [[row[0].text for row in grid.rows] for grid in grids[:3]]
    assert names == [["best", "pdc", "pid"], ["nothing", "switching"], ["best, no map"]]


def test_a_design_on_an_ensemble_states_its_promise_and_every_law_on_its_rigs() -> None:
    row = {"rigs": 40, "held": 38, "probability": 0.851}
    row |= {
        "worst": {"rest": 1.2, "motion": 0.3, "load": None, "chattering": 0.5},
        "median": dict.fromkeys(("rest", "motion", "load", "chattering"), 0.2),
    }
    found = {
        "laws": {"best": row, "pid, ensemble": row},
        "limits": {name: {"value": 5e-5, "unit": "m"} for name in ("rest", "motion", "load", "chattering")},
        "confidence": 0.95,
        "effects": ["valve-lag"],
        "limiting": None,
        "rescued": {"valve-lag": 0},
        "separate": None,
    }
    shown = law_comparison(ReportData("demo", {"design": controlled.design() | {"ensemble": found}}))
    assert any("at least 85 %" in part.text for part in shown.parts if part.kind == "note")
    grid = next(part for part in shown.parts if part.kind == "grid" and "ensemble" in part.caption)
    assert [cell.text for cell in grid.rows[1]] == [
        "pid, ensemble",
        "38 of 40",
        "0.20 ×; 1.2 ×",
        "0.20 ×; 0.30 ×",
        "0.20 ×; ∞",
        "0.20 ×; 0.50 ×",
    ]
    assert all(
        "ensemble" not in part.caption
        for part in law_comparison(ReportData("demo", {"design": controlled.design()})).parts
        if part.kind == "grid"
    )


def test_the_figures_of_the_thesis_on_control_are_named(material: ReportData) -> None:
    captions = " ".join(part.caption for part in thesis_control(material).parts)
    assert all(f"Figure 7.{number}:" in captions for number in range(28, 35))
    assert "Figure 7." not in " ".join(getattr(part, "caption", "") for part in law_comparison(material).parts)


def test_without_a_design_there_is_no_comparison_and_without_identification_no_figures() -> None:
    assert law_comparison(ReportData("none")) is None
    assert thesis_figures(ReportData("none")) is None
    assert thesis_control(ReportData("none")) is None
    assert law_comparison in SECTIONS


def test_one_slip_is_shown_under_every_model_and_the_claim_on_the_flow_function_is_checked() -> None:
    t = 1e-3 * np.arange(50)
    one = {"time": t, "v": t, "v_model": 0.9 * t, "a": t, "a_model": t}
    rows = {name: np.tile(values, 6) for name, values in one.items()}
    table = Table({"model": [m for m in "ABCDEF" for _ in t], **rows})
    parts = thesis_figures(ReportData("demo", {}, {"identify/friction_replays": table})).parts
    captions = " ".join(part.caption for part in parts)
    assert all(f"Figure 6.{number}:" in captions for number in (*range(14, 20), *range(34, 40)))
    assert "unrounded the approximation is off by at most 0.304 % of the value (claimed: 0.3 %)" in captions
    assert "by 0.167 % for ratios of 0.2 to 0.8 (claimed: less than 0.2 %)" in captions
