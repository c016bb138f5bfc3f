"""What commands print where, and their exit codes; as stored: sessions of commands that follow each other."""

import errno
import json
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from pneucli import cli
from pneucli.cli.commands.effects import plain_equation
from pneucli.cli.program import build
from pneucli.messages.look import curve
from pneucli.pipeline.graph import Context
from pneucli.stages.look import rests
from tests.cli.conftest import Command
from tests.cli.toys import PIPELINE
from tests.stored import hold_against

STORED = Path(__file__).parent / "stored"
SESSIONS: dict[str, list[dict[str, Any]]] = json.loads((STORED / "sessions.json").read_text(encoding="utf-8"))
PASSES = (  # what is another one each time
    (r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(\.\d+)?(Z|\+00:00)?", "WHEN"),
    (r"\d+ (effects on|control laws)", r"N \1"),
    (r"about \d+ (s|min)|no estimate yet", "SOON"),
    (r"(ran in|in|took) \d+(\.\d+)? m?s\b", r"\1 SOON"),
    (r'("seconds": )\d+(\.\d+)?(e-\d+)?', r"\1SOON"),
    (r"! Usage: .*\n(! .*\n)+", "! USAGE\n"),  # in the words of the library
    (r"(No such option: --jason)[^\"\[\n]*", r"\1 "),
)


def changed(step: dict[str, Any], folder: Path) -> None:
    """Do to the files what a person does between two commands."""
    for name in step.get("delete", ()):
        (folder / name).unlink()
    for source, target in step.get("copy", {}).items():
        (folder / target).parent.mkdir(exist_ok=True)
        shutil.copy(folder / source, folder / target)
    for name, text in step.get("append", {}).items():
        (folder / name).write_text((folder / name).read_text() + text)
    for name, pairs in step.get("replace", {}).items():
        text = (folder / name).read_text()
        for old, new in pairs.items():
            assert old in text
            text = text.replace(old, new)
        (folder / name).write_text(text)


@pytest.mark.parametrize("name", SESSIONS)
def test_a_session_is_as_stored(
    pneucli: Command, bench: Path, strokes: Path, tanks: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Times and the folder's own path are left out."""
    monkeypatch.chdir(bench.parent)
    monkeypatch.setenv("COLUMNS", "120")
    lines = []
    for step in SESSIONS[name]:
        changed(step, bench.parent)
        for words in step.get("run", ()):
            told = pneucli(*shlex.split(words))
            lines += [f"$ pneucli {words}", told.out.rstrip(), *(f"! {line}" for line in told.err.splitlines())]
            lines += [f"exit {told.code}"] * bool(told.code)
        lines += [
            text for shown in step.get("show", ()) for text in (f"== {shown}", (bench.parent / shown).read_text())
        ]
        lines += [str(sorted(path.name for path in bench.parent.rglob("*")))] * ("list" in step)
    text = "\n".join(lines).replace(str(bench.parent), "DIR").replace(bench.parent.name, "DIR") + "\n"
    for pattern, instead in PASSES:
        text = re.sub(pattern, instead, text)
    hold_against(STORED / f"{name}.txt", text, rel=1e-9)


# --- what the commands print where, and their exit codes


def with_effects(file: Path, *effects: str) -> Path:
    file.write_text(PIPELINE.replace('["valve-lag"]', str(list(effects))))
    return file


def answer(text: str) -> dict[str, Any]:
    """Standard output as one JSON object and nothing else."""
    content: dict[str, Any] = json.loads(text)
    return content


def test_open_shows_the_report_in_the_browser(pneucli: Command, bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: bool(shown.append(address)) or True)
    assert answer(pneucli("open", bench, "--json").out)["opened"] is True
    assert shown == [(bench.parent / "artifacts" / "bench" / "report" / "report.html").as_uri()]
    monkeypatch.setattr("webbrowser.open", lambda address: False)
    assert "no browser was found" in pneucli("open", bench).out


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


def test_an_effect_is_shown_in_plain_text_and_json_the_source(pneucli: Command) -> None:
    assert "√(2/(R T))" in pneucli("effects", "chamber-leak").out
    assert "\\\\sqrt" in pneucli("effects", "chamber-leak", "--json").out
    assert "\\" not in pneucli("effects", "--verbose").out


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


def test_a_leak_test_has_a_page_with_its_curve(pneucli: Command, tanks: Path) -> None:
    page = tanks / "leak.html"
    done = pneucli("leak", tanks / "decay.csv", "--volume", "2 l", "--limit", "1 l/min", "--html", page)
    text = page.read_text(encoding="utf-8")
    assert (done.code, "<svg" in text, "passes" in text) == (0, True, True)


def test_a_page_has_a_figure_for_each_signal(pneucli: Command, tank: Path, tmp_path: Path) -> None:
    pneucli("look", tank, "--html", tmp_path / "look.html")
    page = (tmp_path / "look.html").read_text(encoding="utf-8")
    assert page.count("<svg") >= 2
    assert "p1 of a tank" in page


def test_a_signal_that_never_rests_has_no_level() -> None:
    assert list(rests(np.linspace(0.0, 1.0, 1000))) == []
    assert list(rests(np.zeros(1000))) == []
