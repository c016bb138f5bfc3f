"""The score sees what became worse, better, or contradicts itself, and the fixtures are answered as stored."""

import io
import json
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from benchmarks import score
from benchmarks.cases import Truth, described_truth, judged, reading_faults, sampled, truth_of
from benchmarks.score import compared, contradictions, essence, measured, next_command, tiles
from pneucli import cli

Row = dict[str, Any]
LEAK = Truth(frozenset({"piston-leak"}), {"piston-leak": {"area": 1e-7}}, mild=frozenset({"valve-lag"}))
HEALTHY = Truth()


def diagnosis(*missing: str, verdict: str = "", error: float = 1.0, **more: Any) -> Row:
    """A row of ``diagnose`` that names some effects."""
    path = [[9.0, 9.0], *([[error, error]] * len(missing))] if missing else [[error, error]]
    found = {
        "verdict": verdict or ("missing-effect" if missing else "adequate"),
        "missing": list(missing),
        "path": path,
    }
    return {"command": "diagnose", "exit": 0, "refused": [], "parameters": {}, "do": "add", **found, **more}


def comparison(error: float, limit: float | None = 1.1, do: str = "run") -> Row:
    """A row of ``compare`` with a test recording."""
    return {"command": "compare", "exit": 0, "error": [error, error], "limit": [limit, limit], "do": do}


def reading(**doubts: int) -> Row:
    """A row of ``ingest``."""
    return {"command": "ingest", "exit": 0, "doubts": doubts, "reads": {"p1": [1e5, 7e5]}, "noise": {"p1": 400.0}}


def judgements(truth: Truth, old: Row, new: Row, *, is_sound: bool = True) -> list[bool | None]:
    """Whether each change of one row is worse, better or neither."""
    command = new["command"]
    return [one.worse for one in compared(truth, {command: old}, {command: new}, is_sound=is_sound)]


def test_a_missed_effect_is_worse_and_a_found_one_better() -> None:
    missed, found = diagnosis(verdict="unexplained", error=9.0), diagnosis("piston-leak")
    assert True in judgements(LEAK, found, missed)
    assert False not in judgements(LEAK, found, missed)
    assert set(judgements(LEAK, missed, found)) == {False, None}  # the verdict is neither


def test_an_equivalent_effect_is_in_the_answer_and_not_exactly_the_hidden_one() -> None:
    twin = judged(LEAK, diagnosis("chamber-leak", twins={"chamber-leak": ["piston-leak"]}))
    assert (twin.found, twin.right, twin.exact, twin.false) == (1, 1, 0, 0)


def test_a_false_name_is_worse_and_a_mild_one_is_not() -> None:
    right = diagnosis("piston-leak")
    assert True in judgements(LEAK, right, diagnosis("piston-leak", "line-delay"))
    assert set(judgements(LEAK, right, diagnosis("piston-leak", "valve-lag"))) == {None}
    said = compared(LEAK, {"diagnose": right}, {"diagnose": diagnosis("piston-leak", "valve-lag")}, is_sound=True)
    assert any("mild 0 -> 1" in one.text for one in said)
    counts = judged(LEAK, diagnosis("piston-leak", "valve-lag", "line-delay"))
    assert (counts.false, counts.mild, counts.right, counts.exact) == (1, 1, 1, 0)


def test_a_healthy_rig_is_silent_or_wrong() -> None:
    assert (judged(HEALTHY, diagnosis()).silent, judged(HEALTHY, diagnosis("stribeck")).silent) == (1, 0)
    assert (judged(HEALTHY, diagnosis()).right, judged(HEALTHY, diagnosis("stribeck")).right) == (1, 0)


def test_a_false_name_in_an_answer_that_was_refused_is_worse() -> None:
    refused = diagnosis(verdict="inconclusive", refused=["supply"])
    assert judgements(HEALTHY, refused, diagnosis())[0] is False
    assert True in judgements(HEALTHY, refused, diagnosis("stribeck"))


def test_a_refusal_is_worse_unless_it_is_right() -> None:
    refused = {"command": "ingest", "exit": 2, "refused": ["E045"]}
    assert judgements(HEALTHY, reading(), refused)[0] is True
    assert judgements(Truth(may_refuse=True), reading(), refused) == [None]


def test_a_fault_is_worse_whatever_is_true() -> None:
    fault = {"command": "diagnose", "exit": 3}
    assert judgements(Truth(may_refuse=True), diagnosis(), fault) == [True]
    assert (judged(LEAK, fault).faults, judged(LEAK, fault).answered, judged(LEAK, fault).effects) == (1, 0, 1)


@pytest.mark.parametrize(("error", "expected"), [(1.06, []), (1.08, [True]), (0.92, [False])])
def test_an_error_changes_by_more_than_the_tolerance(error: float, expected: list[bool]) -> None:
    assert judgements(HEALTHY, diagnosis(error=1.0), diagnosis(error=error)) == expected


def test_the_error_of_a_model_that_lacks_an_effect_is_neither_better_nor_worse() -> None:
    assert judgements(LEAK, comparison(9.0), comparison(20.0)) == [None]
    assert judgements(HEALTHY, comparison(2.0), comparison(3.0)) == [True]


def test_a_new_doubt_about_sound_recordings_is_a_false_alarm() -> None:
    assert judgements(HEALTHY, reading(), reading(supply=1)) == [True]
    assert judgements(HEALTHY, reading(supply=1), reading()) == [False]
    assert judgements(HEALTHY, reading(), reading(supply=1), is_sound=False) == [None]


def test_an_interval_that_loses_the_truth_is_worse() -> None:
    close = diagnosis("piston-leak", parameters={"piston-leak.area": [1.05e-7, 0.9e-7, 1.2e-7]})
    off = diagnosis("piston-leak", parameters={"piston-leak.area": [1.05e-7, 1.04e-7, 1.06e-7]})
    assert judgements(LEAK, close, off) == [True]
    assert (judged(LEAK, close).close, judged(LEAK, close).covered, judged(LEAK, off).covered) == (1, 1, 0)


def test_the_right_interval_of_a_truth_takes_the_place_of_a_tolerance() -> None:
    truth = truth_of(
        {"hidden": ["pressure-lag"], "unknown": "", "parameters": {"pressure-lag": {"time": [0.02, 0.04]}}}
    )
    counts = judged(truth, diagnosis("pressure-lag", parameters={"pressure-lag.time": [0.05, 0.039, 0.06]}))
    assert (counts.parameters, counts.close, counts.covered) == (1, 0, 1)


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([comparison(1.0), diagnosis(do="run")], ""),
        ([comparison(2.7), diagnosis(error=2.7, do="run")], "beyond its limit"),
        ([comparison(1.0), diagnosis(lack_of_fit=True, do="run")], "lack of fit"),
        ([comparison(1.0), diagnosis(do="diagnose")], "adequate, and proposes to diagnose"),
        ([comparison(1.0, do="diagnose"), diagnosis(do="run")], "compare stands within the limit"),
        ([diagnosis("stribeck", verdict="adequate")], "adequate, and effects are missing"),
        ([diagnosis(error=2.7, limit=[None, 1.4], do="run")], "beyond its limit"),
        ([diagnosis("stribeck", lack_of_fit=True)], "all that is missing"),
        ([diagnosis(verdict="unexplained", lack_of_fit=False, do="")], "no lack of fit is present"),
        ([{**comparison(1.0, do="diagnose"), "lack_of_fit": True}], ""),  # a single channel, which the mean hides
        ([comparison(9.0), diagnosis(verdict="missing-effect", error=9.0)], "none is named"),
        ([comparison(9.0), diagnosis("stribeck", error=9.6)], "raises the error"),
        ([comparison(1.0), diagnosis(error=1.2, do="run")], "two errors of one model"),
        ([comparison(1.0), {"command": "report", "tiles": {"The model": "bad"}}], "tile"),
        ([comparison(9.0, do="diagnose"), {"command": "report", "tiles": {"The model": "good"}}], "tile"),
    ],
)
def test_each_contradiction_is_seen_alone(rows: list[Row], said: str) -> None:
    found = contradictions({row["command"]: row for row in rows})
    assert (found == []) if not said else (len(found) == 1 and said in found[0]), found


@pytest.mark.parametrize("path", sorted(score.SCORES.glob("*.jsonl")), ids=lambda path: path.stem)
def test_verdict_error_and_tile_agree_on_every_stored_case(path: Path) -> None:
    cases = score.stored(path.stem)
    assert cases
    assert {name: found for name, rows in cases.items() if (found := contradictions(rows))} == {}


def test_a_new_contradiction_is_worse() -> None:
    old = {"compare": comparison(1.0), "diagnose": diagnosis(do="run")}
    new = {"compare": comparison(1.0, limit=0.9), "diagnose": diagnosis(do="run")}
    assert [one.worse for one in compared(HEALTHY, old, new, is_sound=True)] == [True]
    assert [one.worse for one in compared(HEALTHY, new, old, is_sound=True)] == [False]


def test_a_reading_is_right_if_refused_or_doubted_where_that_is_right() -> None:
    said = {"reads": {"p1": [1e5, 7e5]}, "noise": {"p1": 400}}
    truth, rows = described_truth(said), {"ingest": reading()}
    assert reading_faults(truth, rows) == []
    assert len(reading_faults(described_truth({**said, "noise": {"p1": 900}}), rows)) == 1
    for range_ in ([2e5, 7e5], [1e5, 8e5]):
        assert len(reading_faults(truth, {"ingest": {**reading(), "reads": {"p1": range_}}})) == 1
    refused = {"ingest": {"command": "ingest", "exit": 2, "refused": ["E045"]}}
    assert reading_faults(truth, refused) == ["ingest refuses"]
    assert reading_faults(described_truth({**said, "may_refuse": True}), refused) == []
    doubted = {"ingest": {**reading(reference=1), "reads": {"p1": [2e5, 8e5]}}}
    assert reading_faults(described_truth({**said, "doubts": ["reference"]}), doubted) == []


def test_clock_samples_and_error_tell_how_a_file_was_read() -> None:
    rows = {"ingest": {**reading(), "rate": {"p1": 1000.0}, "samples": 50}, "compare": comparison(1.4)}
    assert reading_faults(described_truth({"rate": {"p1": 1000}, "samples": 50, "error": 2}), rows) == []
    for said in ({"rate": {"p1": 1}}, {"samples": 51}, {"error": 1.3}):
        assert len(reading_faults(described_truth(said), rows)) == 1


def test_an_effect_that_nothing_can_show_is_a_false_name_whatever_else_acts() -> None:
    truth = described_truth({"absent": ["constant-force"]})
    assert (judged(truth, diagnosis("constant-force", "stribeck")).false, judged(truth, diagnosis()).false) == (1, 0)
    assert judgements(truth, diagnosis("stribeck"), diagnosis("line-delay")) == [None]


def test_fitted_recordings_judge_where_none_is_held_out() -> None:
    fitted, held_out = ({"compare": {**comparison(1.0), "error": [3.0, test]}} for test in (None, 1.0))
    fitted["compare"]["limit"] = [1.1, None]
    assert [one.worse for one in compared(HEALTHY, held_out, fitted, is_sound=True)] == [True]
    assert contradictions({**fitted, "diagnose": diagnosis(error=3.0, do="run")}) != []


def test_a_truth_is_read_in_the_form_of_each_world() -> None:
    exam = truth_of({"hidden": {"stribeck": {"static": 22.0}}, "outside_the_catalogue": "several small ones"})
    assert (exam.hidden, exam.unknown, exam.parameters["stribeck"]["static"]) == ({"stribeck"}, False, 22.0)
    rig = truth_of({"hidden": [], "unknown": ["rod-seal-leak"], "parameters": {}, "background": ["presliding"]})
    assert (rig.hidden, rig.unknown, rig.mild) == ({"chamber-leak:2"}, False, {"presliding"})
    assert truth_of({"hidden": [], "unknown": ["a bent rod"], "parameters": {}}).unknown


def test_what_matters_of_an_answer() -> None:
    candidate = {"effect": "stribeck", "indistinguishable_from": ["presliding"], "confidence": 0.987}
    candidate["parameters"] = {"static": {"value": 22.00001, "unit": "N", "ci95": [21.0, 23.0]}}
    answer = {"verdict": "missing-effect", "missing": ["stribeck"], "candidates": [candidate], "plausibility": []}
    answer |= {"ladder": [{"error_train": 9.12345, "error_test": None}]}
    answer |= {"lack_of_fit": {"present": True, "p": 0.0, "use": "train", "limit": 1.41421}}
    row = essence("diagnose", json.dumps(answer))
    assert row["limit"] == [1.414, None]
    former = essence("compare", json.dumps({"error": {"train": 2.0, "test": 3.0}, "error_limit": {"test": 1.5}}))
    assert former == {"error": [2.0, 3.0], "limit": [None, 1.5]}
    assert row["twins"] == {"stribeck": ["presliding"]}
    assert row["parameters"] == {"stribeck.static": [22.0, 21.0, 23.0]}
    assert (row["path"], row["lack_of_fit"], row["refused"]) == ([[9.123, None]], True, [])
    assert essence("ingest", json.dumps({"error": {"code": "E045"}, "exit_code": 2})) == {"refused": ["E045"]}
    assert essence("diagnose", "Traceback") == {}


def test_a_check_refuses_where_it_contradicts_and_not_where_it_doubts() -> None:
    findings = [{"check": "mass", "weight": "contradiction"}, {"check": "supply", "weight": "doubt"}]
    answer = {"missing": [], "candidates": [], "ladder": [], "impossible": ["..."], "plausibility": findings}
    assert essence("diagnose", json.dumps({**answer, "verdict": "inconclusive"}))["refused"] == ["mass"]
    assert essence("diagnose", json.dumps({**answer, "verdict": "adequate"}))["refused"] == []


def test_the_next_command_stands_on_the_line_do_alone() -> None:
    assert (
        next_command("error    1.2\ndo       record more; or:\n         pneucli add x\nwarning  pneucli run\n") == "add"
    )
    assert next_command("do       record more\nwarning  pneucli run\n") == ""


def test_a_tile_has_a_title_and_a_colour() -> None:
    page = '<div class="tile bad"><h2>The model</h2></div><div class="tile"><h2>Controller</h2></div>'
    assert tiles(page) == {"The model": "bad", "Controller": "none"}


def test_a_fault_of_another_command_counts_where_the_diagnosis_answers() -> None:
    case = score.Case("exam", "one", ("identify", "diagnose"), HEALTHY)
    asked = {"identify": {"command": "identify", "exit": 3}, "diagnose": diagnosis()}
    rows = {command: {**row, "seconds": 1.0, "MB": 9} for command, row in asked.items()}
    assert score.Tally.of([(case, rows)]).counts.faults == 1
    assert score.Tally.of([(case, {**rows, "diagnose": {**rows["diagnose"], "exit": 3}})]).counts.faults == 1


def test_a_sample_is_spread_evenly() -> None:
    assert sampled(range(10), 3) == [0, 3, 6]
    assert sampled(range(2), 3) == [0, 1]


def test_worse_answers_are_stored_with_a_reason_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(score, "SCORES", tmp_path)
    monkeypatch.setattr(score, "ACCEPTED", tmp_path / "accepted.toml")
    case = score.Case("exam", "one", ("diagnose",), HEALTHY)
    right, wrong = ({"case": "one", **row, "seconds": 1.0, "MB": 9} for row in (diagnosis(), diagnosis("stribeck")))
    judge = lambda row: score.judge({"exam": [(case, {"diagnose": row})]}, write=True)  # noqa: E731
    assert judge(right) == 0
    assert judge(wrong) == 1
    assert score.stored("exam")["one"]["diagnose"] == right
    score.ACCEPTED.write_text('# reasons\n"exam/o*" = "it sticks"\n"exam/two" = "other"\n')
    assert judge(wrong) == 0
    assert score.stored("exam")["one"]["diagnose"] == {**wrong, "why": "it sticks"}
    assert score.ACCEPTED.read_text() == '# reasons\n"exam/two" = "other"\n'
    assert judge({**wrong, "seconds": 2.0}) == 0
    assert score.stored("exam")["one"]["diagnose"]["why"] == "it sticks"


def test_a_command_that_somebody_asks_to_end_is_run_again(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    program = f"import os, pathlib, signal\nmark = pathlib.Path({str(mark)!r})\n"
    program += "if not mark.exists():\n    mark.touch()\n    os.kill(os.getpid(), signal.SIGTERM)\nprint('again')"
    code, text, seconds, memory = measured([sys.executable, "-c", program])
    assert (code, text) == (0, "again\n")
    assert 0.0 < seconds < 10.0
    assert memory > 1.0  # at its start a process counts what the tests' own one holds


def test_another_program_is_asked_and_not_the_one_in_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other, python = tmp_path / "other" / "pneucli", tmp_path / "python"
    other.mkdir(parents=True)
    (other / "__init__.py").touch()
    (other / "__main__.py").write_text("print('{}')")
    python.write_text(f'#!/bin/sh\nPYTHONPATH={other.parent} exec {sys.executable} "$@"\n')
    python.chmod(0o755)
    monkeypatch.chdir(score.ROOT)
    assert score.package(str(python)) == other
    case = score.Case("fixtures", "one", ("history",), HEALTHY, score.ROOT / "pipelines" / "demo.toml")
    (row,) = score.ask(case, str(python), tmp_path / "kept")
    assert (row["exit"], (tmp_path / "kept" / "fixtures" / "one" / "history.json").read_text()) == (0, "{}\n")


def test_a_case_is_asked_once_and_again_if_it_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def answer(words: list[str]) -> tuple[int, str, float, float]:
        asked.append(words[4])
        return 2, '{"error": {"code": "E001"}, "exit_code": 2}', 1.0, 9.0

    monkeypatch.setattr(score, "measured", answer)
    pipeline = tmp_path / "rig" / "pipeline.toml"
    pipeline.parent.mkdir()
    pipeline.write_text("one")
    case = score.Case("exam", "one", ("ingest", "diagnose"), HEALTHY, pipeline)
    assert not score.is_kept(case, tmp_path / "kept")
    rows = [score.ask(case, "python", tmp_path / "kept") for _ in range(2)]
    assert asked == ["ingest", "diagnose"]
    assert rows[0] == rows[1]
    assert rows[0][1] == {"case": "one", "command": "diagnose", "exit": 2, "refused": ["E001"], "seconds": 1.0, "MB": 9}
    pipeline.write_text("other")
    score.ask(case, "python", tmp_path / "kept")
    assert asked == ["ingest", "diagnose"] * 2


def measured_here(words: list[str]) -> tuple[int, str, float, float]:
    """As ``measured``, in this process: a new one takes longer to start than a fixture to be answered."""
    out = io.StringIO()
    with redirect_stdout(out), redirect_stderr(io.StringIO()), mock.patch.object(sys, "argv", words[3:]):
        try:
            cli.main()
        except SystemExit as end:
            return int(end.code or 0), out.getvalue(), 0.0, 0.0
    return 0, out.getvalue(), 0.0, 0.0


def test_the_fixtures_are_answered_as_stored(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(score, "measured", measured_here)
    monkeypatch.setenv("PNEUCLI_THREADS", "1")
    code = score.main(["fixtures", "--kept", str(tmp_path), "--jobs", "1"])
    assert code == 0, capsys.readouterr().out
