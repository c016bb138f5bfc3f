"""``look``: raw files as they would be taken, in the terminal, as JSON and as a page."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from pneucli.messages.look import curve
from pneucli.paths import from_here
from pneucli.stages.look import look_at, rests

from .conftest import Command

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
