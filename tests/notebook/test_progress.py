"""How far a work is: one line that is redrawn on a terminal, a line every half minute in a log."""

import io
import sys
import time
from collections.abc import Callable

import pytest

from pneucli.notebook import progress
from pneucli.notebook.progress import ProgressLine


class Terminal(io.StringIO):
    """A terminal that remembers what was written to it."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def pass_time(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """A clock that stands until it is told that seconds passed."""
    now = [1000.0]
    monkeypatch.setattr("pneucli.notebook.progress.time.monotonic", lambda: now[0])

    def pass_seconds(seconds: float) -> None:
        now[0] += seconds

    return pass_seconds


def shown(written: str) -> str:
    """What stands on a terminal's last line."""
    line = ""
    for part in written.rsplit("\n", maxsplit=1)[-1].split("\r"):
        line = part + line[len(part) :]
    return line.rstrip()


def test_an_estimate_counts_down_and_is_not_stretched(pass_time: Callable[[float], None]) -> None:
    line = ProgressLine(redrawn=False)
    line.begin("diagnose", 60.0)
    line("fitting stribeck")
    pass_time(20.0)
    assert line.text() == "  diagnose: fitting stribeck (20 s, about 40 s left)"
    pass_time(41.0)
    assert line.text() == "  diagnose: fitting stribeck (1 min 1 s, longer than estimated)"
    line.begin("report", None)
    assert line.text() == "  report: starting (0 s, no estimate yet)"


def test_counted_parts_tell_the_rest_by_those_done_in_this_run(pass_time: Callable[[float], None]) -> None:
    line = ProgressLine(redrawn=False)
    line("90 of 100 rows", 0.9)  # done in an earlier run
    pass_time(10.0)
    assert line.text().endswith("(10 s, no estimate yet)")
    line("92 of 100 rows", 0.92)
    assert line.text().endswith("(10 s, about 40 s left)")
    pass_time(5.0)
    assert line.text().endswith("(15 s, about 35 s left)")
    line("0 of 8 chunks", 0.0)  # another count
    pass_time(10.0)
    line("2 of 8 chunks", 0.25)
    assert line.text().endswith("(25 s, about 30 s left)")


def test_on_a_terminal_the_line_stands_in_its_place_and_is_gone_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr(progress, "REDRAW_INTERVAL", 0.01)
    monkeypatch.setenv("TERM", "xterm")
    with progress.progress(quiet=False) as show:
        show.begin("compare", None)
        for message in ("a long message, which the next one covers", "short"):
            show(message)
            time.sleep(0.1)
        assert isinstance(sys.stderr, Terminal)
        assert shown(sys.stderr.getvalue()) == "  compare: short (0 s, no estimate yet)"
        progress.print_message("running report")
        time.sleep(0.1)
    written = sys.stderr.getvalue()
    assert written.count("\n") == 1
    assert shown(written.partition("\n")[0]) == "running report"
    assert shown(written) == ""


def test_in_a_log_a_line_comes_at_its_interval_only(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "LOG_INTERVAL", 0.05)
    with progress.progress(quiet=False) as show:
        for number in range(20):
            show(f"fitting {number}")
        time.sleep(0.18)
    lines = capsys.readouterr().err.splitlines()
    assert 2 <= len(lines) <= 4
    assert set(lines) == {"  fitting 19 (0 s, no estimate yet)"}


def test_quiet_shows_nothing(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "LOG_INTERVAL", 0.01)
    with progress.progress(quiet=True) as show:
        show.begin("compare", 1.0)
        show("fitting", 0.5)
        time.sleep(0.05)
    assert capsys.readouterr().err == ""
