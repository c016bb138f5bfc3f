"""``pneucli plot``: a picture of a recording in a file, or in a terminal that shows pictures."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pneucli
from pneucli import cli

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
