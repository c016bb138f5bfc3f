"""Figures of a run say what was measured and what each model makes of it, in units that people read."""

import json
import os
import select
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pneucli
from pneucli import cli
from pneucli.messages.history import Model
from pneucli.notebook import plots
from pneucli.notebook.plots import GAP_NOTE


def test_a_recording_is_drawn_by_channel_with_its_fit(axis: pneucli.Run) -> None:
    figure = axis.plot.recording("driven_2", ["x", "v"])
    x, _ = figure.axes
    rows = axis.residuals.query("recording == 'driven_2' and channel == 'x'")
    np.testing.assert_allclose(x.lines[0].get_ydata(), 1e3 * rows["measured"])
    assert x.get_ylabel() == "x in mm"
    answer = next(c for c in axis.answer("compare")["channels"] if (c["recording"], c["channel"]) == ("driven_2", "x"))
    assert f"fit {answer['fit_percent']:.1f} %" in x.lines[1].get_label()
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_models_of_other_runs_are_in_the_same_panel(axis: pneucli.Run) -> None:
    (panel,) = axis.plot.recording("driven_2", ["x"], compare_with=[axis]).axes
    assert len(panel.lines) == 3


def test_every_model_that_was_compared_is_drawn(axis: pneucli.Run) -> None:
    (panel,) = axis.plot.models("driven_2", ["x"]).axes
    labels = [line.get_label() for line in panel.lines]
    assert labels[0] == "measured"
    assert labels[1].startswith("base (present): fit ")


def test_the_other_figures_come_out(valve: pneucli.Run, axis: pneucli.Run) -> None:
    assert valve.plot.valve_map().axes[0].get_ylabel() == "pressure of chamber 1 in bar"
    image = valve.plot.correlation().axes[0].images[0].get_array()
    np.testing.assert_array_equal(image, valve.correlation)
    (own, u, supply) = valve.plot.residual_correlation("stairs_2", "p1").axes
    assert [a.get_ylabel() for a in (own, u, supply)] == ["with itself", "with u", "with p_supply"]
    assert own.lines[0].get_ydata()[0] == pytest.approx(1.0)


def labels(figure: Any) -> list[str]:
    return [tick.get_text() for tick in figure.axes[0].get_yticklabels()]


def test_the_ladder_shows_the_models_before_the_present_one_and_what_is_suggested(
    axis: pneucli.Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after ``add``: the diagnosis knows only the present model, the history also the one before."""
    compared = [
        Model(effects, {"test": error, "train": None}, data, "", i == 2, {})
        for i, (effects, error, data) in enumerate([([], 9.0, "old"), ([], 8.0, "d"), (["stribeck"], 2.0, "d")])
    ]
    monkeypatch.setattr(plots, "compared_models", lambda folder: compared)
    ladder = [
        {"add": add, "error_train": 1.0, "error_test": error} for add, error in ((None, 2.0), ("piston-leak", 1.1))
    ]
    monkeypatch.setattr(type(axis), "answer", lambda run, stage: {"missing": ["piston-leak"], "ladder": ladder})
    figure = axis.plot.ladder()
    assert labels(figure) == ["base model", "+ stribeck (present)", "+ piston-leak"]
    test_bars = [bar.get_width() for bar in figure.axes[0].patches[:3]]
    assert test_bars == [8.0, 2.0, 1.1]


def test_a_gap_in_the_model_is_explained(axis: pneucli.Run, monkeypatch: pytest.MonkeyPatch) -> None:
    assert GAP_NOTE not in [axis.plot.recording("driven_2", ["x"]).axes[0].get_title(loc="right")]
    rows = axis.residuals.copy()
    at_end = rows.index[(rows["recording"] == "driven_2") & (rows["channel"] == "x")][100:200]
    rows.loc[at_end, ["measured", "residual"]] = np.nan
    monkeypatch.setattr(type(axis), "residuals", rows)
    (panel,) = axis.plot.recording("driven_2", ["x"]).axes
    assert panel.get_title(loc="right") == GAP_NOTE
    assert np.isnan(panel.lines[1].get_ydata()[100:200]).all()


def test_the_ladder_of_a_run_that_was_compared_once(axis: pneucli.Run) -> None:
    assert labels(axis.plot.ladder())[0] == "base model (present)"


@pytest.mark.parametrize("name", ["driven_9", "x"])
def test_an_unknown_name_is_an_input_error(axis: pneucli.Run, name: str) -> None:
    with pytest.raises(pneucli.InputError, match="was not compared"):
        axis.plot.recording(name)


# --- ``pneucli plot``: a picture of a recording in a file, or in a terminal that shows pictures


DEVICE_ATTRIBUTES = b"\x1b[c"  # a program asks the terminal what it can do
SIXEL, KITTY = b"\x1bP", b"\x1b_G"  # begin of a picture


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["pneucli", "plot", *map(str, words)])
        with pytest.raises(SystemExit) as exit_:
            cli.main()
        return int(exit_.value.code or 0), *capsys.readouterr()

    return run


Command = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def folder(axis: pneucli.Run) -> Path:
    axis.bring_up("compare")
    return axis.artifacts


@pytest.mark.parametrize(("name", "begin"), [("a.png", b"\x89PNG"), ("a.svg", b"<?xml"), ("a.PDF", b"%PDF")])
def test_the_ending_of_the_file_decides_its_format(
    command: Command, folder: Path, tmp_path: Path, name: str, begin: bytes
) -> None:
    code, out, err = command(folder, "driven_2", "--channel", "x", "--save", tmp_path / "new" / name)
    assert (code, err) == (0, "")
    assert (tmp_path / "new" / name).read_bytes().startswith(begin)
    assert "shown    driven_2 (test): x " in out
    assert name in out


def test_an_unknown_ending_is_refused_before_anything_runs(command: Command, tmp_path: Path) -> None:
    code, _, err = command(tmp_path / "no.toml", "--save", "a.bmp")
    assert code == 2
    assert "--save a.png" in err


def test_without_a_name_the_worst_recording_that_judges_the_model_is_shown(command: Command, folder: Path) -> None:
    code, out, _ = command(folder, "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["schema"] == "pneucli/plot/1"
    assert answer["use"] == "test"
    assert answer["file"] is None
    assert [c["channel"] for c in answer["channels"]] == ["x", "v", "a"]


@pytest.mark.parametrize(
    ("words", "mend"), [(["driven_9"], 'did you mean "driven_'), (["driven_2", "--channel", "p7"], "known: a, v, x")]
)
def test_unknown_names_are_input_errors(command: Command, folder: Path, words: list[str], mend: str) -> None:
    code, _, err = command(folder, *words)
    assert code == 2
    assert mend in err


def test_without_a_terminal_it_says_how_to_save(command: Command, folder: Path) -> None:
    code, out, _ = command(folder, "driven_2")
    assert code == 0
    assert "no terminal" in out
    assert "--save driven_2.png" in " ".join(out.split())


def test_the_residual_is_drawn_over_the_band_of_a_correct_model(axis: pneucli.Run) -> None:
    above, below = axis.plot.residuals("driven_2", ["x"]).axes
    answer = next(c for c in axis.answer("compare")["channels"] if (c["recording"], c["channel"]) == ("driven_2", "x"))
    assert f"fit {answer['fit_percent']:.1f} %" in above.lines[1].get_label()
    band = below.patches[0].get_extents().transformed(below.transData.inverted())
    assert (band.y0, band.y1) == pytest.approx((-2e3 * answer["noise"], 2e3 * answer["noise"]))
    rows = axis.residuals.query("recording == 'driven_2' and channel == 'x'")
    drawn = below.lines[0].get_ydata()
    assert np.nanmax(drawn) == pytest.approx(1e3 * rows["residual"].max(), rel=1e-6)


def test_a_saved_picture_is_small_however_long_the_recording(axis: pneucli.Run, tmp_path: Path) -> None:
    file = tmp_path / "a.svg"
    axis.plot.residuals("driven_2", ["x"]).savefig(file)
    assert ET.parse(file).getroot().tag.endswith("svg")
    assert file.stat().st_size < 1_000_000


def in_terminal(answer: bytes, *words: object) -> bytes:
    """What the program writes to a terminal that gives ``answer`` when asked for its abilities."""
    pty = pytest.importorskip("pty")
    termios = pytest.importorskip("termios")
    own, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (50, 120))
    line = [sys.executable, "-m", "pneucli", "plot", *map(str, words)]
    outside = {**os.environ, "TERM": "xterm-256color"}
    process = subprocess.Popen(line, stdin=theirs, stdout=theirs, stderr=theirs, env=outside, close_fds=True)
    os.close(theirs)
    written, answered, end = b"", 0, time.monotonic() + 120
    while time.monotonic() < end:
        ready, _, _ = select.select([own], [], [], 0.2)
        try:
            written += os.read(own, 1 << 16) if ready else b""
        except OSError:  # the other end is closed
            break
        if written.count(DEVICE_ATTRIBUTES) > answered:
            answered += 1
            os.write(own, answer)
        if not ready and process.poll() is not None:
            break
    assert process.wait(10) == 0, written
    os.close(own)
    return written


@pytest.mark.skipif(sys.platform == "win32" or sys.version_info < (3, 11), reason="needs a pseudo terminal")
@pytest.mark.parametrize(("abilities", "picture"), [(b"\x1b[?62;4;22c", True), (b"\x1b[?62;22c", False)])
def test_a_terminal_with_sixel_graphics_shows_the_picture(folder: Path, abilities: bytes, picture: bool) -> None:
    pytest.importorskip("textual_image", reason="no textual-image (extra terminal)")
    written = in_terminal(abilities, folder, "driven_2", "--channel", "x")
    assert (SIXEL in written) is picture
    assert (b"--save" in written) is not picture
