"""Every sentence of every command is as stored, and findings, reasons and manoeuvres have one each."""

import ast
import html
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import pytest

import pneucli
from pneucli import messages
from pneucli.diagnose.candidate import Reason
from pneucli.figure import read
from pneucli.fleet.row_files import FleetRow, result_from_diagnosis
from pneucli.messages import plan, run
from pneucli.messages.diagnose import REJECTION_REASONS, Answer, CandidateAnswer, reason_sentence, verdict_sentence
from pneucli.messages.findings import OTHERS, VALVE
from pneucli.plan.bench import ManoeuvreKind
from pneucli.report.page import to_html
from pneucli.report.sections.diagnosis import section as diagnosis
from pneucli.report.summaries import to_markdown
from tests.messages.stored_calls import FOLDER, Call, answer, said, stored
from tests.report.bench import whole

CALLS = [(path.stem, call) for path in sorted(FOLDER.glob("*.json")) for call in stored(path.stem)["calls"]]
VERDICTS = [answer("verdict", call["with"][0]) for call in stored("verdict")["calls"] if call["shows"] == "the verdict"]


@pytest.mark.parametrize(("command", "call"), CALLS, ids=[f"{command}: {call['shows']}" for command, call in CALLS])
def test_what_is_said_is_what_was_stored(command: str, call: Call) -> None:
    assert json.loads(json.dumps(said(command, call))) == call["says"]


def one_line(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize("found", VERDICTS, ids=range(len(VERDICTS)))
def test_terminal_summary_page_and_fleet_show_the_same_sentence(found: dict[str, Any]) -> None:
    sentence = verdict_sentence(read(Answer, found))
    shown = found | {"sentence": sentence}
    report = whole()
    report = replace(report, answers=report.answers | {"diagnose": shown})
    evidence = diagnosis(report)
    assert evidence is not None
    page = to_html(report, [evidence])  # no other section shows a diagnosis
    text = html.unescape(re.sub(r"<script.*?</script>|<[^>]+>", " ", page, flags=re.DOTALL))
    assert one_line(messages.render("diagnose", shown, "a.toml")).startswith(f"found {sentence}")
    assert f"found {sentence} " in one_line("\n".join(run.lines({"diagnose": shown}, [], [], "r.html", "a.toml")))
    assert sentence in to_markdown(report)
    assert one_line(text).count(sentence) == 1  # on the first screen; Evidence has the pictures and the rivals
    assert result_from_diagnosis(FleetRow(1, "a", "2026-01-01", {}), read(Answer, shown)).sentence == sentence


def told_codes() -> set[str]:
    """The codes that the program tells, as far as they stand in a call."""
    texts = (path.read_text(encoding="utf-8") for path in Path(pneucli.__file__).parent.rglob("*.py"))
    trees = [ast.parse(text) for text in texts if "pneucli.messages.findings import" in text]
    calls = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Call) and node.args]
    codes = [call.args[0] for call in calls if isinstance(call.func, ast.Name) and call.func.id in ("Finding", "tell")]
    named = [part.value for code in codes for part in ast.walk(code) if isinstance(part, ast.Constant)]
    return {str(name) for name in named}


def test_every_finding_has_one_sentence_and_every_sentence_a_finding() -> None:
    assert told_codes() == VALVE.keys() | OTHERS.keys()


def test_every_manoeuvre_and_every_reason_has_words_of_its_own() -> None:
    assert set(plan.MANOEUVRES) == set(get_args(ManoeuvreKind))
    assert set(REJECTION_REASONS) == set(get_args(Reason)) - {"supported"}
    assert len(set(REJECTION_REASONS.values())) == len(REJECTION_REASONS)


@pytest.mark.parametrize("reason", sorted(set(get_args(Reason)) - {"supported"}))
def test_chance_is_stated_only_where_it_decided(reason: str) -> None:
    refused = {"effect": "leak", "title": "Leak", "error_before": 9.4, "error_after": 1.05, "reason": reason}
    candidate = read(CandidateAnswer, refused | {"supported": False, "indistinguishable_from": []})
    text = reason_sentence(candidate, [], "apart", "It creeps.")
    assert ("chance" in text) == (reason == "not-significant")


def test_what_explains_much_without_a_named_effect_is_not_said_to_explain_little() -> None:
    refused = {"effect": "leak", "title": "Leak", "error_before": 9.4, "error_after": 1.05, "supported": False}
    candidate = read(CandidateAnswer, refused | {"reason": "explained-by-unknown", "indistinguishable_from": []})
    text = reason_sentence(candidate, ["stribeck"], "apart")
    assert text == "Leak. It probably only resembles stribeck, or an effect outside the catalogue."
    beside = reason_sentence(replace(candidate, beside=["stribeck"]), ["stribeck"], "apart")
    assert beside == f"Leak. {REJECTION_REASONS['explained-by-unknown']}"
