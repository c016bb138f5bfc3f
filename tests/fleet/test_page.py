"""The page of a large fleet: small enough to send, ranked, and safe against what names may hold."""

import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pneucli.figure import read
from pneucli.fleet.output import page_data, to_html, to_openmetrics
from pneucli.fleet.row_files import RowResult, Trend, find_change_points, parameter_trends, robust_scatter
from pneucli.messages.fleet import Answer

RNG = np.random.default_rng(1)
CHANGE = {"name": "piston-leak.area", "effect": "piston-leak", "before": 0.0, "after": 5.2e-8, "unit": "m^2"}


def row(number: int, day: int, changed: bool, failed: bool) -> RowResult:
    rig = f"axis-{number:05d}"
    stored = {
        "rig": rig,
        "date": f"2026-11-{day:02d}",
        "verdict": None if failed else "unexplained",
        "missing": ["stribeck"] if number % 3 else [],
        "changes": [CHANGE | {"confidence": 0.99999}] if changed else [],
        "p_value": 10.0 ** -(number % 90) if changed else 1.0,
        "error_test": float(RNG.uniform(1.0, 9.0)),
        "failure": f"raw/{rig}/21.csv, line {number}: {'bad ' * 80}" if failed else None,
        "cause": f"kind {number % 7}" if failed else None,
        "report": f"rows/{rig}/2026-11-{day:02d}/report.html" if changed else None,
        "seconds": 1.0,
    }
    return read(RowResult, stored)


def fleet(rigs: int, dates: int) -> tuple[Answer, list[RowResult], list[Trend]]:
    results = [
        row(n, d, d == dates and n % 20 == 0, d == dates and n % 50 == 1)
        for n in range(rigs)
        for d in range(1, dates + 1)
    ]
    days = tuple(f"2026-11-{d:02d}" for d in range(1, dates + 1))
    trends = [
        Trend(f"axis-{n:05d}", name, "N", days, tuple(RNG.uniform(10, 20, dates)), tuple(RNG.uniform(0, 1, dates)))
        for n in range(rigs)
        for name in ("friction.coulomb", "friction.viscous", "valve.overlap")
    ]
    failures = [{"cause": f"kind {k}", "rows": 5} for k in range(7)]
    answer = {"fleet": "plant", "rigs": rigs, "rows": len(results), "changed": 1, "failed": 7, "breaks": 0, "done": 0,
              "alarm_rate": 1e-3, "repeatability": None, "failures": failures, "missing": {"stribeck": 9}}  # fmt: skip
    return read(Answer, answer), results, trends


def test_ten_thousand_rigs_at_thirty_dates_fit_into_five_megabytes() -> None:
    """Every failure has a message of its own, every tenth rig changed or failed."""
    answer, results, trends = fleet(10_000, 30)
    assert len(to_html(answer, results, trends).encode()) <= 5_000_000


def data(page: str) -> Any:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found
    return json.loads(found[1])


def test_rigs_are_sorted_by_evidence_of_change_then_by_change_points() -> None:
    answer, results, trends = fleet(60, 3)
    broken = [
        Trend(t.rig, t.name, t.unit, t.dates, t.values, t.errors, (2,)) if t.rig == "axis-00007" else t for t in trends
    ]
    rigs = [one[0] for one in page_data(answer, results, broken)["rigs"]]
    assert rigs[:3] == ["axis-00040", "axis-00020", "axis-00007"]
    assert len(rigs) == 60


def test_the_page_lists_changes_with_links_and_failures_with_causes() -> None:
    found = data(to_html(*fleet(60, 3)))
    first = found["rigs"][0]
    words = found["words"]
    assert [words[c[0]] for c in first[5]] == ["piston-leak.area"]
    assert first[9] == "rows/axis-00040/2026-11-03/report.html"
    failed = next(one for one in found["rigs"] if one[8])
    assert words[failed[8][0]].startswith("kind")
    assert found["changes"] == {"piston-leak.area": 3}


def test_a_trend_states_parameter_unit_and_dates() -> None:
    found = data(to_html(*fleet(3, 4)))
    named = [[found["words"][i] for i in panel[1:5]] for panel in found["trends"]]
    assert named[0] == ["friction.coulomb", "N", "2026-11-01", "2026-11-04"]
    assert len(named) == 9


@pytest.mark.parametrize("name", ["</script><script>alert(1)</script>", '"><img src=x>'])
def test_a_name_cannot_break_out_of_the_page(name: str) -> None:
    answer, results, trends = fleet(1, 1)
    page = to_html(replace(answer, fleet=name), [replace(results[0], rig=name)], trends)
    assert name not in page
    assert data(page)["rigs"][0][0] == name


def test_labels_of_metrics_are_escaped() -> None:
    answer, results, _ = fleet(1, 1)
    text = to_openmetrics(replace(answer, fleet='a"b\nc'), results)
    assert 'fleet="a\\"b\\nc"' in text
    assert text.endswith("# EOF\n")


# --- levels of a parameter over dates, and where they change


TRENDS_RNG = np.random.default_rng(3)


@pytest.mark.parametrize("cuts", [(), (8,), (5, 12)])
def test_a_step_of_six_errors_is_a_change_point(cuts: tuple[int, ...]) -> None:
    levels = np.searchsorted(cuts, np.arange(20), side="right") * 6.0
    assert find_change_points(levels + TRENDS_RNG.standard_normal(20), np.ones(20)) == cuts


def test_pure_noise_rarely_has_a_change_point() -> None:
    """200 series of 20 dates: Schwarz's penalty leaves few with a cut."""
    cut = [bool(find_change_points(TRENDS_RNG.standard_normal(20), np.ones(20))) for _ in range(200)]
    assert np.mean(cut) < 0.05


def test_understated_errors_give_no_change_points() -> None:
    cut = [bool(find_change_points(5.0 + TRENDS_RNG.standard_normal(30), np.full(30, 1e-3))) for _ in range(200)]
    assert np.mean(cut) < 0.15
    assert robust_scatter(np.array([1.0, 2.0])) < 1e-9


def test_trends_are_by_rig_and_parameter_with_dates_in_order() -> None:
    records = [("a", f"2026-01-0{day}", "friction.coulomb", "N", float(day), 0.1) for day in (3, 1, 2)]
    (trend,) = parameter_trends([*records, ("b", "2026-01-01", "friction.coulomb", "N", 1.0, 0.1)])
    assert (trend.rig, trend.dates, trend.values) == ("a", ("2026-01-01", "2026-01-02", "2026-01-03"), (1.0, 2.0, 3.0))
