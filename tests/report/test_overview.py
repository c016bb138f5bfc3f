"""The first screen: the fall of the error, what is missing, what the controller holds, and the failing stretch."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from pneucli.report.figure import with_gaps
from pneucli.report.overview import find_worst_recording, overview
from pneucli.report.page import to_html
from pneucli.report.page_elements import Section
from pneucli.report.report_data import ReportData
from pneucli.report.sections.diagnosis import section as diagnosis
from tests.report.bench import fallen, without


@pytest.fixture(scope="module")
def after() -> ReportData:
    return fallen()


def evidence(report: ReportData) -> Section:
    """The chapter on the diagnosis, the one of these tests: a page of all takes seconds."""
    section = diagnosis(report)
    assert section is not None
    return section


def test_the_picture_shows_the_held_out_recording_with_the_first_models_largest_error(after: ReportData) -> None:
    found = find_worst_recording(after)
    assert found is not None
    assert (found.recording, found.channel, found.kind) == ("axis_<b>&_$2$", "x", "held-out ")
    assert found.error_ratios == (50.0, 3.0)
    assert found.before is not None
    # the fault is in the last second where x > 0.12 m, sin > 0.5: from 3 + 1/12 to 3 + 5/12 s; bins are of 0.2 s
    assert found.stretch == pytest.approx((3.0, 3.4), abs=0.2)


def test_a_channel_without_noise_is_not_pictured(material: ReportData) -> None:
    compared = material.answers["compare"]
    silent = [{**c, "noise": 0.0, "ratio_to_noise": None} if c["channel"] == "x" else c for c in compared["channels"]]
    found = find_worst_recording(
        replace(material, answers={**material.answers, "compare": {**compared, "channels": silent}})
    )
    assert found is not None
    assert found.channel == "v"


def test_the_verdict_stands_in_the_page_without_any_script(after: ReportData) -> None:
    plain = re.sub(r"<script.*?</script>", "", to_html(after, [evidence(after)]), flags=re.DOTALL)
    top = plain[: plain.index("<nav")]
    for words in (
        "29.3 → 1.93 × noise",
        "nothing further detected",
        "5.0 µm at rest",
        "It failed most in",
        "pneucli export",
    ):
        assert words in top
    assert "cylinder · compared on 2026-11-22 · base model with stribeck and piston-leak · 2 recordings" in top


def test_implausible_findings_come_first(material: ReportData) -> None:
    finding = {"check": "silent", "signal": "p1", "recording": "axis_1", "found": "p1 stays", "mend": "check it"}
    finding |= {"weight": "doubt"}
    other = {**finding, "signal": "p2"}
    answers = {**material.answers, "ingest": {**material.answers["ingest"], "plausibility": [finding, other]}}
    doubted = replace(material, answers=answers)
    assert overview(doubted).doubt == "Doubtful: axis_1, p1 stays; check it. 1 more under Measurements."
    page = to_html(doubted, [])
    assert page.index("Doubtful: axis_1") < page.index('class="tiles"')
    assert overview(material).doubt == ""


def test_a_first_screen_comes_out_of_ingest_alone(material: ReportData) -> None:
    bare = overview(without(material, "identify", "compare", "diagnose", "design", "simulate"))
    assert (bare.tiles, bare.pictures, bare.failed) == ([], {}, "")


def test_a_restart_is_a_gap() -> None:
    assert (
        np.isnan(with_gaps(np.arange(6.0), np.array([0, 0, 0, 1, 1, 1]))).tolist() == [False] * 2 + [True] + [False] * 3
    )
