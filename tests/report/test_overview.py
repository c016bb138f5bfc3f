"""The first screen: the fall of the error, what is missing, what the controller holds, and the failing stretch."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from pneucli.report import EarlierAnswer, ReportData, to_html
from pneucli.report.figure import with_gaps
from pneucli.report.overview import overview, selection_path
from pneucli.report.page_elements import Section
from pneucli.report.sections.diagnosis import section as diagnosis
from pneucli.report.worst_recording import find_worst_recording
from tests.report.bench import fallen, without


@pytest.fixture(scope="module")
def after() -> ReportData:
    return fallen()


def evidence(report: ReportData) -> Section:
    """The chapter on the diagnosis, the one of these tests: a page of all takes seconds."""
    section = diagnosis(report)
    assert section is not None
    return section


def test_the_tile_of_the_model_states_error_added_effect_and_interval(after: ReportData) -> None:
    tile = overview(after).tiles[0]
    # sqrt((9^2 + 50^2 + 1.2^2) / 3) and sqrt((1 + 9 + 1.21) / 3)
    assert tile.large == "29.3 → 1.93 × noise"
    assert tile.text.startswith("With piston-leak: area = 0.0520 ± 0.0010 mm².")
    assert "Worst: x in axis_1, 3.00 × noise" in tile.text
    assert tile.tone == ""  # near the noise, not at it


def test_the_tile_of_the_missing_effect_states_its_evidence(material: ReportData, after: ReportData) -> None:
    tile = overview(material).tiles[1]
    assert (tile.large, tile.tone) == ("piston-leak", "bad")
    assert tile.text.startswith(f"{material.answers['diagnose']['sentence']} Evidence: piston-leak area = ")
    adequate = overview(after).tiles[1]
    assert (adequate.large, adequate.tone) == ("nothing further detected", "good")
    assert adequate.text.endswith("1 of 1 other effects are detectable, such as valve-leak (area 0.020 mm²).")


def test_the_tile_of_the_controller_states_accuracy_and_failures(material: ReportData) -> None:
    tile = overview(material).tiles[2]
    assert (tile.large, tile.tone) == ("5.0 µm at rest", "")
    assert "Not robust against presliding" in tile.text
    loop = material.answers["simulate"]
    robust = overview(replace(material, answers={**material.answers, "simulate": {**loop, "robust": {}}})).tiles[2]
    assert ("Not robust" in robust.text, robust.tone) == (False, "good")
    missed = {**loop, "closed_loop": {**loop["closed_loop"], "steps": {"steady_um": 99.0}}}
    tile = overview(replace(material, answers={**material.answers, "simulate": missed})).tiles[2]
    assert (tile.large, tile.tone) == ("99 µm at rest", "bad")
    assert "Fails: steps." in tile.text


def test_the_ladder_goes_down_to_the_noise_floor(after: ReportData) -> None:
    steps = selection_path(after)
    assert [step.label for step in steps] == ["base model with stribeck", "+ valve-lag", "+ piston-leak − valve-lag"]
    assert steps[0].length == 1.0
    assert steps[-1].length == pytest.approx(np.log(1.93) / np.log(29.3), rel=0.01)


def test_the_diagnosed_effect_is_the_last_step_and_marked_as_not_added(material: ReportData) -> None:
    last = selection_path(replace(material, answers={**material.answers, "diagnose": _judged_by_train(material)}))[-1]
    assert (last.label, last.error, last.only_if) == ("+ piston-leak", "1.02", True)


def _judged_by_train(material: ReportData) -> dict[str, object]:
    ladder = [{**step, "error_test": step["error_train"]} for step in material.answers["diagnose"]["ladder"]]
    return {**material.answers["diagnose"], "ladder": ladder}


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


def test_without_an_earlier_model_the_picture_has_one_model(material: ReportData) -> None:
    found = find_worst_recording(material)
    assert found is not None
    assert found.before is None
    words = re.findall(r"<text[^>]*>([^<]*)</text>", overview(material).pictures["wide"])
    assert {"measured", "model"} <= set(words)
    assert "before" not in words


def test_the_first_screen_states_the_worst_failure_and_the_next_step(material: ReportData, after: ReportData) -> None:
    now = overview(replace(material, file="axis.toml"))
    assert now.failed.startswith("It fails most in axis_1: x at piston position 120 to 140 mm; 61 % of the error of x")
    assert now.following.startswith("Next: pneucli add axis.toml --suggested")
    assert overview(after).failed.startswith("It failed most in ")
    assert overview(after).following == "Next: pneucli export pipeline.toml --to c"
    assert overview(without(material, "diagnose")).following == "Next: pneucli diagnose pipeline.toml"


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


def test_the_evidence_of_the_diagnosis_that_named_the_effect_stays(after: ReportData) -> None:
    page = to_html(after, [evidence(after)])
    chapter = page[page.index('<section id="diagnosis">') :].partition("</section>")[0]
    assert "Base model with stribeck: The model lacks piston-leak" in chapter
    assert "Nothing is missing" not in chapter  # the first screen says it
    assert "residual of p1 in axis_1 before and after adding it" in chapter


def test_a_restart_is_a_gap() -> None:
    assert (
        np.isnan(with_gaps(np.arange(6.0), np.array([0, 0, 0, 1, 1, 1]))).tolist() == [False] * 2 + [True] + [False] * 3
    )


def test_the_first_screen_states_probability_and_control_law(after: ReportData) -> None:
    candidate = {"effect": "piston-leak", "confidence": 0.97}
    earlier = [EarlierAnswer({"candidates": [candidate], "missing": ["piston-leak"]})]
    model, _, controller = overview(replace(after, diagnoses=earlier)).tiles
    assert "mm²; present with a probability of 97 %" in model.text
    assert "Of 3 laws “best” holds it; next is “pid”, 90 µm off." in controller.text
