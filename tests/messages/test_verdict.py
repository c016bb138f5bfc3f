"""The verdict and the warnings of a diagnosis, in words: one sentence, the same wherever it is shown."""

from __future__ import annotations

import html
import math
import re
from dataclasses import replace
from typing import Any

import pytest

from pneucli import messages
from pneucli.fleet.row_files import result_from_diagnosis
from pneucli.messages import run
from pneucli.messages.verdict import detection_limit_sentence, location_phrase, verdict_sentence
from pneucli.report import to_html
from pneucli.report.sections.diagnosis import section as diagnosis
from pneucli.report.summaries import to_markdown
from tests.report.bench import whole

REST = {
    "character": "mostly irregular; 25 % of it is a dry friction, a function of piston position",
    "channel": "force",
    "times_noise": 3.0,
    "subsystem": "mechanics",
    "share": 0.25,
    "variable": "x",
}
GIVEN = {"add": None, "error_train": 8.0, "error_test": 9.0}


def candidate(effect: str, title: str, *equivalents: str) -> dict[str, Any]:
    of = {"effect": effect, "title": title, "indistinguishable_from": list(equivalents), "supported": True}
    return of | {"parameters": {}, "confidence": 0.9, "error_before": 9.0, "error_after": 1.04, "why": "", "reason": ""}


def diagnosed(verdict: str, *named: dict[str, Any], after: float = 1.04, **other: Any) -> dict[str, Any]:
    """An answer of ``diagnose`` whose path ends with an effect that is not named."""
    steps = [{"add": c["effect"], "error_train": after, "error_test": after} for c in named]
    refused = {"add": "presliding", "error_train": 0.5, "error_test": 0.5}
    answer = {
        "verdict": verdict, "missing": [c["effect"] for c in named], "candidates": list(named), "held_out": "apart",
        "ladder": [GIVEN, *steps, refused], "model": {"effects": []}, "detectable": [], "moved": [], "warnings": [],
        "next_experiment": None, "unexplained": None, "parameters": {}, **other,
    }  # fmt: skip
    return answer | {"sentence": verdict_sentence(answer)}


STRIBECK = candidate("stribeck", "Stribeck friction")
LEAK = candidate("piston-leak", "Leak across the piston", "heat-transfer", "chamber-leak")
LEFT = {"channel": "p1", "size": 1.4, "subsystem": "chambers", "over": "x", "time_constant_s": 0.3, "share": 1.0}
ANSWERS = {
    "missing": diagnosed("missing-effect", STRIBECK, explained_share=0.98),
    "two": diagnosed("missing-effect", STRIBECK, LEAK, discrepancy=[LEFT]),
    "doubtful": diagnosed("unexplained", STRIBECK | {"confidence": 0.52}, after=3.0, unexplained=REST),
    "one of two doubtful": diagnosed("missing-effect", STRIBECK, LEAK | {"confidence": 0.7}),
    "no probability": diagnosed("missing-effect", STRIBECK | {"confidence": None}),
    "worse": diagnosed("missing-effect", STRIBECK, after=12.0, explained_share=0.0),
    "damped": diagnosed("missing-effect", STRIBECK, after=12.0, explained_share=0.25, relative_error=0.87),
    "named and unexplained": diagnosed("unexplained", STRIBECK, after=3.0, explained_share=0.9, unexplained=REST),
    "unexplained": diagnosed("unexplained", unexplained=REST),
    "adequate": diagnosed("adequate"),
    "excused": diagnosed("adequate", lack_of_fit={"excused": 2}),
    "inconclusive": diagnosed(
        "inconclusive",
        detectable=[
            {"effect": name, "size": None, "typical": typical, "would_show": ""}
            for name, typical in (("stribeck", False), ("presliding", False), ("extra-mass", True))
        ],
    ),
    "impossible": diagnosed("inconclusive", impossible=["run_1, x moves at 112 m/s; check [signals] x"]),
}
HELD_OUT = "× noise on recordings that were not fitted"
DOUBTED = STRIBECK | {"supported": False, "confidence": 0.47, "error_after": 3.19}
SMALL = "What is left does not exceed noise and parameter uncertainty"


@pytest.mark.parametrize(
    ("case", "sentence"),
    [
        (
            "missing",
            f"The model lacks stribeck (stribeck friction): with it the error falls from 9.00 to 1.04 {HELD_OUT}; it "
            f"explains 98 % of the squared error beyond noise. {SMALL}.",
        ),
        (
            "two",
            "The model lacks stribeck (stribeck friction) and piston-leak (leak across the piston): with them the "
            f"error falls from 9.00 to 1.04 {HELD_OUT}. These recordings cannot distinguish piston-leak from "
            f"chamber-leak and heat-transfer. {SMALL}; it is largest in p1, 1.40 × its noise (chambers, over x, "
            "lasting 0.30 s).",
        ),
        (
            "doubtful",
            "The model probably lacks stribeck (stribeck friction; 52 % probable): with it the error falls from 9.00 "
            f"to 3.00 {HELD_OUT}. What is left is mostly irregular; 25 % of it is a dry friction, a function of piston "
            "position: force errs by 3.0 times its noise (mechanics); no effect of the catalogue explains it.",
        ),
        (
            "one of two doubtful",
            "The model probably lacks stribeck (stribeck friction) and piston-leak (leak across the piston; 70 % "
            f"probable): with them the error falls from 9.00 to 1.04 {HELD_OUT}. These recordings cannot distinguish "
            f"piston-leak from chamber-leak and heat-transfer. {SMALL}.",
        ),
        (
            "no probability",
            f"The model lacks stribeck (stribeck friction): with it the error falls from 9.00 to 1.04 {HELD_OUT}. "
            f"{SMALL}.",
        ),
        (
            "worse",
            f"The model lacks stribeck (stribeck friction): with it the error rises from 9.00 to 12.0 {HELD_OUT}. "
            f"{SMALL}.",
        ),
        (
            "damped",
            f"The model lacks stribeck (stribeck friction): with it the error rises from 9.00 to 12.0 {HELD_OUT}, no "
            "more than by chance: in mm and bar it falls to 87 %; it explains 25 % of the squared error beyond noise. "
            f"{SMALL}.",
        ),
        (
            "named and unexplained",
            f"The model lacks stribeck (stribeck friction): with it the error falls from 9.00 to 3.00 {HELD_OUT}; it "
            "explains 90 % of the squared error beyond noise. What is left is mostly irregular; 25 % of it is a dry "
            "friction, a function of piston position: force errs by 3.0 times its noise (mechanics); no effect of the "
            "catalogue explains it.",
        ),
        (
            "unexplained",
            f"No effect of the catalogue explains these recordings: the error is 9.00 {HELD_OUT}. What is left is "
            "mostly irregular; 25 % of it is a dry friction, a function of piston position: force errs by 3.0 times "
            "its noise (mechanics).",
        ),
        (
            "adequate",
            f"Nothing is missing that these recordings could show: the error is 9.00 {HELD_OUT}. {SMALL}.",
        ),
        (
            "excused",
            f"Nothing is missing that these recordings could show: the error is 9.00 {HELD_OUT}. {SMALL}, but for 2 "
            "segments beside a break-away, where little decides when a piston starts.",
        ),
        (
            "inconclusive",
            "No statement is possible: 2 of 3 effects are undetectable at a typical size; the error is 9.00 "
            f"{HELD_OUT}.",
        ),
        (
            "impossible",
            "run_1, x moves at 112 m/s; check [signals] x. "
            "Recordings contradict the stated rig: no effect was looked for.",
        ),
    ],
)
def test_the_verdict_states_what_is_named_and_then_what_is_left(case: str, sentence: str) -> None:
    assert ANSWERS[case]["sentence"] == sentence


def one_line(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize("case", ANSWERS)
def test_terminal_summary_page_and_fleet_show_the_same_sentence(case: str) -> None:
    answer = ANSWERS[case]
    sentence = answer["sentence"]
    report = whole()
    report = replace(report, answers=report.answers | {"diagnose": answer})
    evidence = diagnosis(report)
    assert evidence is not None
    page = to_html(report, [evidence])  # no other section shows a diagnosis
    text = html.unescape(re.sub(r"<script.*?</script>|<[^>]+>", " ", page, flags=re.DOTALL))
    assert one_line(messages.render("diagnose", answer, "a.toml")).startswith(f"found {sentence}")
    assert f"found {sentence} " in one_line("\n".join(run.lines({"diagnose": answer}, [], [], "r.html", "a.toml")))
    assert sentence in to_markdown(report)
    assert one_line(text).count(sentence) == 1  # on the first screen; Evidence has the pictures and the rivals
    assert result_from_diagnosis(answer)["sentence"] == sentence


@pytest.mark.parametrize(
    ("null", "limit"), [(0.0, "above 2 N"), (1.0, "from a difference of 2 N"), (None, "at 2 N"), (math.inf, "at 2 N")]
)
def test_a_detection_limit_counts_from_the_null(null: float | None, limit: str) -> None:
    assert limit in detection_limit_sentence("A force", "force", 2.0, "N", null)
    assert "cannot detect it" in detection_limit_sentence("A force", "force", None, "N", null)


def test_a_detection_limit_states_where_the_effect_acts() -> None:
    where = [location_phrase("length", 0.08, "m")]
    assert "(damping; length 80 mm)" in detection_limit_sentence("A cushion", "damping", 8.0, "N s/m", 0.0, where)


def test_an_effect_that_takes_the_place_of_a_parameter_is_told_beside_it() -> None:
    """Where all motion has one direction, a constant force is dry friction."""
    force = LEAK | {"supported": False, "reason": "replaces-base-parameter", "effect": "constant-force"}
    force |= {"indistinguishable_from": ["friction.coulomb"]}
    asymmetry = force | {"effect": "friction-asymmetry"}
    text = verdict_sentence(diagnosed("unexplained", unexplained=REST) | {"candidates": [force, asymmetry]})
    assert text.endswith(
        "These recordings cannot distinguish constant-force and friction-asymmetry from friction.coulomb, which the "
        "model has: they determine only what both explain together."
    )


@pytest.mark.parametrize(("confidence", "told"), [(0.47, True), (0.3, True), (0.29, False), (None, False)])
def test_the_likeliest_effect_is_told_though_it_is_not_named(confidence: float | None, told: bool) -> None:
    answer = diagnosed("unexplained", unexplained=REST)
    weaker = LEAK | {"supported": False, "confidence": 0.01}
    text = verdict_sentence(answer | {"candidates": [weaker, DOUBTED | {"confidence": confidence}]})
    assert ("The likeliest, stribeck (stribeck friction), is present with" in text) == told
    assert ("with it the error goes from 9.00 to 3.19 × noise" in text) == told
    assert "piston-leak" not in text


def test_the_likeliest_effect_is_told_with_the_effects_that_its_errors_rest_on() -> None:
    """Otherwise they disagree with the error of the given model."""
    answer = diagnosed("unexplained", unexplained=REST)
    text = verdict_sentence(answer | {"candidates": [DOUBTED | {"confidence": 0.47, "beside": ["presliding"]}]})
    assert "with 47 % probability: added to presliding, it takes the error from 9.00 to 3.19" in text
