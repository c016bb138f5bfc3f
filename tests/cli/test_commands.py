"""What the commands print where, and their exit codes."""

import errno
import json
import re
import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from pneucli import cli
from pneucli.cli.commands.effects import plain_equation
from pneucli.cli.program import build
from pneucli.messages.look import curve
from pneucli.paths import from_here
from pneucli.pipeline.context import Context
from pneucli.stages.look import look_at, rests
from tests.cli.conftest import Command
from tests.cli.toys import PIPELINE


def effects_of(file: Path) -> list[str]:
    effects: list[str] = tomllib.loads(file.read_text())["model"]["effects"]
    return effects


def with_effects(file: Path, *effects: str) -> Path:
    file.write_text(PIPELINE.replace('["valve-lag"]', str(list(effects))))
    return file


def answer(text: str) -> dict[str, Any]:
    """Standard output as one JSON object and nothing else."""
    content: dict[str, Any] = json.loads(text)
    return content


@pytest.mark.parametrize("stage", ["ingest", "identify", "compare", "diagnose", "report"])
def test_json_is_one_object_on_standard_output_and_the_same_when_nothing_is_to_do(
    pneucli: Command, bench: Path, stage: str
) -> None:
    first, second = (pneucli(stage, bench, "--json") for _ in range(2))
    assert (first.code, second.code) == (0, 0)
    assert answer(first.out)["schema"] == f"toy/{stage}/1"
    assert second.out == first.out
    assert "running ingest (first time)" in first.err
    assert second.err == ""


def test_without_a_terminal_short_work_prints_one_line(pneucli: Command, bench: Path) -> None:
    error = pneucli("ingest", bench).err
    assert re.fullmatch(r"running ingest \(first time\): 1 file, 0.0 MB; (about \d+ s|no estimate yet)\n", error)


def test_quiet_says_nothing_on_standard_error(pneucli: Command, bench: Path) -> None:
    result = pneucli("ingest", bench, "--quiet")
    assert result.out.startswith("read     1 recordings, 0 to fit and 1 to test\n")
    assert result.err == ""


def test_artifacts_go_next_to_the_file_or_to_out(pneucli: Command, bench: Path) -> None:
    pneucli("report", bench)
    assert (bench.parent / "artifacts" / "bench" / "report" / "report.html").is_file()
    pneucli("report", bench, "--out", bench.parent / "elsewhere")
    assert (bench.parent / "elsewhere" / "report" / "report.html").is_file()


def test_run_exits_1_where_a_check_fails_and_says_value_and_limit(pneucli: Command, bench: Path) -> None:
    result = pneucli("run", bench)
    assert result.code == 1
    assert "checks   compare.error.test = 2 (max 1.5): FAILED" in result.out
    assert pneucli("run", with_effects(bench, "valve-lag", "valve-leak")).code == 0


def test_run_summarises_the_model_in_five_lines(pneucli: Command, bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(bench.parent)
    pneucli("add", bench, "--suggested")
    lines = [line.split(maxsplit=1) for line in pneucli("run", bench).out.splitlines()]
    assert lines == [
        ["error", "2.00 → 1.00 × noise on test recordings with valve-leak"],
        ["added", "valve-leak"],
        ["found", "Nothing is missing."],
        ["checks", "1 passed"],
        ["report", "artifacts/bench/report/report.html"],
    ]


def test_run_names_the_missing_effect_and_the_command_that_adds_it(pneucli: Command, bench: Path) -> None:
    out = pneucli("run", bench).out
    assert "error    2.00 × noise on test recordings\n" in out
    assert "found    The model lacks valve-leak." in out
    assert f"do pneucli add {from_here(str(bench))} --suggested" in " ".join(out.split())


def test_verbose_shows_the_tables_behind_the_verdict(pneucli: Command, bench: Path) -> None:
    plain, verbose = pneucli("compare", bench).out, pneucli("compare", bench, "-v").out
    assert verbose.startswith(plain)
    assert "step       test  p1" in verbose
    assert "step       test  p1" not in plain


def test_the_history_lists_every_model_once_the_oldest_first(pneucli: Command, bench: Path) -> None:
    assert answer(pneucli("history", bench, "--json").out)["models"] == []
    pneucli("compare", bench)
    pneucli("add", bench, "valve-leak")
    pneucli("add", bench, "piston-leak")
    pneucli("remove", bench, "piston-leak")
    models = answer(pneucli("history", bench, "--json").out)["models"]
    assert [(m["effects"][1:], m["error"]["test"], m["current"]) for m in models] == [
        ([], 2.0, False),
        (["valve-leak"], 1.0, True),
        (["valve-leak", "piston-leak"], 0.0, False),
    ]
    assert pneucli("history", bench).out.startswith("error    2.00 → 1.00 × noise on test recordings with valve-leak\n")


def test_errors_on_other_data_are_listed_separately(pneucli: Command, bench: Path) -> None:
    pneucli("compare", bench)
    bench.write_text(PIPELINE + '\n[compare]\nhorizon = "1 s"\n')
    assert "have changed since" in pneucli("history", bench).err
    pneucli("compare", bench)
    models = answer(pneucli("history", bench, "--json").out)["models"]
    assert [m["data"] for m in models] == ["horizon 0.5", "horizon 1"]
    out = pneucli("history", bench).out
    assert out.startswith("error    2.00 × noise on test recordings\n")
    assert "not to be compared with the above" in out


def test_suggested_adds_what_the_diagnosis_names_and_then_nothing(pneucli: Command, bench: Path) -> None:
    first, second = (answer(pneucli("add", bench, "--suggested", "--json").out) for _ in range(2))
    assert (first["added"], second["added"]) == (["valve-leak"], [])
    assert effects_of(bench) == ["valve-lag", "valve-leak"]
    assert first["recordings"] == [{"recording": "step", "use": "test", "before": 2.0, "after": 1.0}]


def test_add_without_an_effect_says_what_it_wants(pneucli: Command, bench: Path) -> None:
    result = pneucli("add", bench)
    assert (result.code, result.out) == (2, "")
    assert "--suggested" in result.err


def test_diagnose_after_run_does_not_run_again(pneucli: Command, bench: Path) -> None:
    pneucli("run", bench)
    assert pneucli("diagnose", bench).err == ""


def test_open_shows_the_report_in_the_browser(pneucli: Command, bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: bool(shown.append(address)) or True)
    assert answer(pneucli("open", bench, "--json").out)["opened"] is True
    assert shown == [(bench.parent / "artifacts" / "bench" / "report" / "report.html").as_uri()]
    monkeypatch.setattr("webbrowser.open", lambda address: False)
    assert "no browser was found" in pneucli("open", bench).out


def test_run_lists_the_stages_that_ran_and_those_that_do_not_apply(pneucli: Command, bench: Path) -> None:
    first, second = (answer(pneucli("run", bench, "--json").out) for _ in range(2))
    assert [stage["stage"] for stage in first["stages"] if stage["ran"]][:2] == ["ingest", "identify"]
    assert not any(stage["ran"] for stage in second["stages"])
    design = next(stage for stage in first["stages"] if stage["stage"] == "design")
    assert design["skipped"] == "there is no cylinder to control"
    assert first["checks"] == [{"path": "compare.error.test", "limit": {"max": 1.5}, "value": 2.0, "passed": False}]


def test_a_check_path_without_a_value_is_an_input_error(pneucli: Command, bench: Path) -> None:
    bench.write_text(PIPELINE.replace("compare.error.test", "compare.eror.test"))
    result = pneucli("run", bench)
    assert result.code == 2
    assert 'did you mean "error"?' in result.err


def test_a_stage_that_does_not_apply_is_an_error_when_asked_by_name(pneucli: Command, bench: Path) -> None:
    for _ in range(2):  # found out, and remembered
        result = pneucli("design", bench)
        assert (result.code, result.out) == (2, "")
        assert "there is no cylinder to control" in result.err
    assert pneucli("export", bench, "--to", "c").code == 2


def test_a_plant_is_exported_without_a_controller_and_designs_none(pneucli: Command, bench: Path) -> None:
    result = pneucli("export", bench, "--to", "fmu", "--json")
    assert answer(result.out)["to"] == ["fmu"]
    assert "running design" not in result.err
    assert pneucli("export", bench, "--to", "fmu").err == ""  # and is up to date
    status = answer(pneucli("status", bench, "--json").out)
    assert {stage["stage"]: stage["state"] for stage in status["stages"]}["export"] == "up to date"


def test_earlier_export_targets_are_exported_again(pneucli: Command, bench: Path) -> None:
    bench.write_text(PIPELINE.replace("[signals]", '[rig.cylinder]\nstroke = "0.2 m"\n[signals]'))
    pneucli("export", bench, "--to", "csv")
    assert answer(pneucli("export", bench, "--to", "c", "--json").out)["to"] == ["c", "csv"]


def test_exclude_reaches_the_stage_and_holds_for_the_report(pneucli: Command, bench: Path) -> None:
    pneucli("diagnose", bench, "--exclude", "valve-leak", "--exclude", "stribeck")
    pneucli("report", bench)
    status = answer(pneucli("status", bench, "--json").out)
    assert {stage["stage"]: stage["state"] for stage in status["stages"]}["diagnose"] == "up to date"
    assert answer(pneucli("diagnose", bench, "--json").out)["excluded"] == []


def test_status_lists_stale_stages_with_reasons_and_runs_nothing(pneucli: Command, bench: Path) -> None:
    assert "ingest    stale: never done" in pneucli("status", bench).out
    assert not (bench.parent / "artifacts").exists()
    pneucli("compare", bench)
    pneucli("diagnose", bench)
    bench.write_text(PIPELINE + '\n[compare]\nhorizon = "1 s"\n')
    lines = dict(line.split(maxsplit=1) for line in pneucli("status", bench).out.splitlines())
    assert lines["ingest"] == "up to date"
    assert lines["identify"] == lines["diagnose"] == "stale: new [compare]"
    assert lines["compare"] == "stale: new [compare], identify is stale"


def test_add_and_remove_change_the_file_keep_its_words_and_show_both_errors(pneucli: Command, bench: Path) -> None:
    added = answer(pneucli("add", bench, "valve-leak", "piston-leak", "--json").out)
    assert (added["before"]["test"], added["after"]["test"]) == (2.0, 0.0)
    assert effects_of(bench) == ["valve-lag", "valve-leak", "piston-leak"]
    removed = pneucli("remove", bench, "valve-lag")
    assert effects_of(bench) == ["valve-leak", "piston-leak"]
    assert "error    0 → 1.00 × noise on test recordings\n" in removed.out
    assert "# the bench by the window" in bench.read_text()


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (("add", "valve-leek"), 'did you mean "valve-leak"?'),
        (("remove", "valve-log"), 'did you mean "valve-lag"?'),
    ],
)
def test_an_unknown_effect_leaves_the_file_alone(
    pneucli: Command, bench: Path, words: tuple[str, str], hint: str
) -> None:
    result = pneucli(words[0], bench, words[1])
    assert result.code == 2
    assert hint in result.err
    assert bench.read_text() == PIPELINE


def test_a_fault_of_the_input_is_exit_2_with_one_message_and_no_traceback(pneucli: Command, bench: Path) -> None:
    result = pneucli("compare", with_effects(bench, "time-skew"), "--json")
    assert result.code == 2
    assert "error: raw.csv, line 3: no number" in result.err
    assert "Traceback" not in result.err


def test_errors_are_json_under_json(pneucli: Command, bench: Path) -> None:
    told = answer(pneucli("compare", with_effects(bench, "time-skew"), "--json").out)
    assert (told["schema"], told["exit_code"]) == ("pneucli/error/1", 2)
    assert told["error"] == {"where": "raw.csv, line 3", "found": "no number", "wanted": "", "mend": "", "code": ""}
    wrong = pneucli("compare", bench, "--json", "--jason")
    assert wrong.code == 2
    assert "--jason" in answer(wrong.out)["error"]["found"]


def test_a_fault_of_the_program_is_exit_3_one_line_and_a_traceback_in_a_file(pneucli: Command, bench: Path) -> None:
    result = pneucli("compare", with_effects(bench, "stribeck"), "--quiet")
    assert (result.code, result.out) == (3, "")
    assert len(result.err.splitlines()) == 1
    log = Path(result.err.split("traceback in ")[1].split(";")[0])
    assert "KeyError: 'a bug'" in log.read_text()
    log.unlink()


def test_a_full_disk_is_exit_2_and_says_where_and_leaves_no_half_folder(
    pneucli: Command, bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(context: Context) -> None:
        (context.out / "part").write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("tests.cli.toys.ingest.run", full)
    result = pneucli("ingest", bench)
    assert (result.code, result.out) == (2, "")
    assert "artifacts/bench/ingest: No space left on device" in result.err
    assert "mend: free some space" in result.err
    assert not list((bench.parent / "artifacts" / "bench").glob("*ingest*"))


def test_too_little_memory_is_exit_2(pneucli: Command, bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def huge(context: Context) -> None:
        raise MemoryError

    monkeypatch.setattr("tests.cli.toys.ingest.run", huge)
    assert pneucli("ingest", bench).code == 2


def test_control_characters_in_raw_files_do_not_reach_the_terminal(
    pneucli: Command, bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pneucli.messages.render", lambda *what, **how: "column \x1b[2J\nsecond line")
    assert pneucli("ingest", bench).out == "column \\x1b[2J\nsecond line\n"


def test_status_writes_nothing_even_where_artifacts_are(pneucli: Command, bench: Path) -> None:
    pneucli("ingest", bench)
    bench.write_text(PIPELINE + "# a comment\n")
    there = {path: path.stat().st_mtime_ns for path in bench.parent.rglob("*")}
    assert pneucli("status", bench).code == 0
    assert {path: path.stat().st_mtime_ns for path in bench.parent.rglob("*")} == there


def test_debug_shows_the_traceback(pneucli: Command, bench: Path) -> None:
    result = pneucli("compare", with_effects(bench, "stribeck"), "--debug")
    assert result.code == 3
    assert "Traceback" in result.err


def test_ctrl_c_is_130(pneucli: Command, bench: Path) -> None:
    assert pneucli("compare", with_effects(bench, "dead-volume"), "--quiet").code == 130


@pytest.mark.parametrize("words", [("compare",), ("compare", "none.toml"), ("conpare",), ("run", "x.toml", "--jason")])
def test_a_wrong_command_line_is_exit_2(pneucli: Command, words: tuple[str, ...]) -> None:
    result = pneucli(*words)
    assert (result.code, result.out) == (2, "")
    assert result.err


def test_effects_lists_the_catalogue_and_shows_one(pneucli: Command) -> None:
    catalogue = answer(pneucli("effects", "--json").out)["effects"]
    listed = [line.split()[0] for line in pneucli("effects").out.splitlines()]
    assert listed == [effect["name"] for effect in catalogue]
    page = pneucli("effects", listed[0])
    assert page.code == 0
    assert plain_equation(catalogue[0]["equation"]) in page.out
    assert pneucli("effects", f"{listed[0]}x").code == 2


COMMANDS = typer.main.get_command(build()).commands  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_takes_the_common_options(name: str) -> None:
    options = {flag for parameter in COMMANDS[name].params for flag in parameter.opts}
    assert {"--json", "--verbose", "-v", "--quiet"} <= options


@pytest.mark.parametrize("words", [[], *([name] for name in COMMANDS)], ids=lambda words: " ".join(words) or "pneucli")
def test_help_cuts_nothing_and_fits_a_terminal_of_80_columns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("sys.argv", ["pneucli", *words, "--help"])
    with pytest.raises(SystemExit):
        cli.main()
    text = capsys.readouterr().out
    shown = [line for line in text.splitlines() if not line.startswith("Usage:")]
    assert [line for line in shown if len(line) > 80 or line.endswith("...")] == []
    whole = "".join(text.split())  # a line may be broken at a hyphen
    described = [COMMANDS[name].help for name in (words or COMMANDS)]
    assert [one for one in described if "".join(one.split()) not in whole] == []


def test_verbose_tells_more(pneucli: Command, bench: Path) -> None:
    pneucli("report", bench)
    assert "ran in" in pneucli("status", bench, "-v").out
    assert len(pneucli("open", bench, "-v").out) > len(pneucli("open", bench).out)
    assert "rms error" in pneucli("add", bench, "valve-leak", "-v").out
    assert ":" in pneucli("effects", "-v").out.splitlines()[1]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--to", "xml"), "csv, st or c"),
        (("a.csv",), "--take"),
        (("--take", "a.csv"), "no plan"),
        (("--first", "--effects", "valve-leak"), "--first alone"),
    ],
)
def test_plan_refuses_what_it_cannot_do_before_anything_runs(
    pneucli: Command, bench: Path, arguments: tuple[str, ...], said: str
) -> None:
    told = pneucli("plan", bench, *arguments)
    assert told.code == 2
    assert said in told.err
    assert "running" not in told.err


def test_an_effect_is_shown_in_plain_text_and_json_the_source(pneucli: Command) -> None:
    assert "√(2/(R T))" in pneucli("effects", "chamber-leak").out
    assert "\\\\sqrt" in pneucli("effects", "chamber-leak", "--json").out
    assert "\\" not in pneucli("effects", "--verbose").out


# --- ``diff`` on the command line, with toy stages


def other_bench(bench: Path, *effects: str) -> Path:
    """A second pipeline on the same raw file."""
    folder = bench.parent / "other"
    folder.mkdir()
    for name in ("raw.csv", "bench.toml"):
        shutil.copy(bench.parent / name, folder)
    return with_effects(folder / "bench.toml", *effects)


def test_pipelines_are_compared_first_and_folders_read_as_they_are(pneucli: Command, bench: Path) -> None:
    other = other_bench(bench, "valve-lag", "valve-leak")
    first = pneucli("diff", bench, other, "--json")
    assert first.code == 0
    assert "running compare" in first.err
    answer = json.loads(first.out)
    assert answer["schema"] == "pneucli/diff/1"
    assert answer["effects"] == {"only_a": [], "only_b": ["valve-leak"]}
    assert (answer["a"]["error"]["test"], answer["b"]["error"]["test"]) == (2.0, 1.0)
    folders = [file.parent / "artifacts" / "bench" for file in (bench, other)]
    bench.unlink()
    again = pneucli("diff", *folders)
    assert again.err == ""
    assert "only B: valve-leak" in again.out
    assert "2.00 → 1.00 × noise" in again.out


def test_a_verdict_is_told_only_of_the_model_as_it_is(pneucli: Command, bench: Path) -> None:
    pneucli("diagnose", bench)
    pneucli("compare", bench)
    folder = bench.parent / "artifacts" / "bench"
    sides = json.loads(pneucli("diff", folder, folder, "--json").out)
    assert sides["a"]["verdict"] == "missing-effect"
    with_effects(bench, "valve-leak")
    (bench.parent / "raw.csv").write_text("t,p\n0,1\n1,3\n")
    sides = json.loads(pneucli("diff", bench, folder, "--json").out)
    assert sides["a"]["verdict"] is None


def test_a_folder_without_a_compared_model_is_an_input_error(pneucli: Command, bench: Path) -> None:
    pneucli("ingest", bench)
    result = pneucli("diff", bench.parent / "artifacts" / "bench", bench)
    assert result.code == 2
    assert "no model was compared there" in result.err


# --- ``look``: raw files as they would be taken, in the terminal, as JSON and as a page


T = np.arange(1200) / 100
U = np.repeat([5.0, -4.0, 6.0, -8.0], 300)
P = 1.013 + 4.0 * np.clip(np.cumsum(U) / 600, 0.0, 1.0)


@pytest.fixture
def tank(tmp_path: Path) -> Path:
    rows = "".join(f"{t:.2f},{u:g},{p:.5f},ok\n" for t, u, p in zip(T, U, P, strict=True))
    path = tmp_path / "a tank.csv"
    path.write_text(f"t [s],u [V],p1 [bar(a)],state\n{rows}", encoding="utf-8")
    return path


def test_signals_are_shown_with_curves_rests_and_what_is_left_out(pneucli: Command, tank: Path) -> None:
    shown = pneucli("look", tank).out
    assert re.search(r"t \[s\] +time +s ", shown)
    assert "reads    a tank: valve, 1200 samples, 100 Hz, 11.99 s" in shown
    assert "▁" in shown
    assert '"state": texts, "ok" 1200 times' in shown
    assert f"pneucli init DIR --from '{from_here(str(tank))}'" in " ".join(shown.split())


def test_the_answer_says_units_rests_and_doubts(pneucli: Command, tank: Path) -> None:
    answer = json.loads(pneucli("look", tank, "--json").out)
    assert answer["schema"] == "pneucli/look/1"
    signals = {one["signal"]: one for one in answer["recordings"][0]["signals"]}
    assert signals["p1"]["unit"] == "Pa"
    assert signals["p1"]["least"] == pytest.approx(1.013e5)
    assert signals["u"]["rests"][0]["share"] == pytest.approx(0.25, abs=0.02)
    assert {round(one["level"]) for one in signals["u"]["rests"]} == {5, -4, 6, -8}
    least, most = signals["p1"]["noise_ci95"]
    assert 0.0 < least <= signals["p1"]["noise"] <= most


def test_a_repair_of_no_signal_names_the_recording_alone(pneucli: Command, tank: Path) -> None:
    tank.write_text(tank.read_text(encoding="utf-8") + "12.00,-8,1.0", encoding="utf-8")
    assert "a tank: line 1202, the last, is cut off" in pneucli("look", tank, "-v").out


def test_one_sample_of_many_shows_in_the_curve(pneucli: Command, tmp_path: Path) -> None:
    p1 = 1.5 + 0.5 * np.sin(np.arange(12_000) / 900)
    p1[7770:7776] = [2.0, 3.0, 4.0, 4.0, 3.0, 2.0]
    rows = "".join(f"{k / 100:.2f},{np.sign(p):g},{p:.5f}\n" for k, p in enumerate(p1))
    (tmp_path / "a.csv").write_text(f"t [s],u [V],p1 [bar(a)]\n{rows}", encoding="utf-8")
    (one,) = json.loads(pneucli("look", tmp_path / "a.csv", "--json").out)["recordings"]
    signal = next(one for one in one["signals"] if one["signal"] == "p1")
    assert max(signal["values"]) == pytest.approx(4e5)
    assert len(signal["values"]) <= 402
    line = curve(signal["time"], signal["values"])
    assert line.index(max(line)) == int(len(line) * 77.72 / 119.99)


def test_a_page_has_a_figure_for_each_signal(pneucli: Command, tank: Path, tmp_path: Path) -> None:
    pneucli("look", tank, "--html", tmp_path / "look.html")
    page = (tmp_path / "look.html").read_text(encoding="utf-8")
    assert page.count("<svg") >= 2
    assert "p1 of a tank" in page


def test_what_waits_for_people_is_a_doubt_and_the_rest_is_shown(tmp_path: Path) -> None:
    rows = "".join(f"{u:g},{p:.5f}\n" for u, p in zip(U, P, strict=True))
    (tmp_path / "a.csv").write_text(f"u [V],p1 [zorps]\n{rows}", encoding="utf-8")
    answer = look_at([tmp_path / "a.csv"])
    assert any("time: a ? waits" in one for one in answer.doubts)
    assert {one.signal for one in answer.columns} == {"u", "p1"}


def test_a_file_that_cannot_be_read_is_refused_in_one_line(pneucli: Command, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("nothing\nhere\n", encoding="utf-8")
    found = pneucli("look", tmp_path / "a.csv")
    assert found.code == 2
    assert "no table of numbers" in found.err


def test_a_signal_that_never_rests_has_no_level() -> None:
    assert list(rests(np.linspace(0.0, 1.0, 1000))) == []
    assert list(rests(np.zeros(1000))) == []
