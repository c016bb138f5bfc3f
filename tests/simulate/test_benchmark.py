"""The benchmark of the simulation core runs to its end, and its accuracy holds."""

import shutil

import pytest

from benchmarks import simulate


@pytest.mark.slow  # where nothing is compiled yet
@pytest.mark.skipif(shutil.which("gcc") is None, reason="the benchmark compares with C, compiled by gcc")
def test_the_small_benchmark_finishes_and_meets_its_accuracy(capsys: pytest.CaptureFixture[str]) -> None:
    assert simulate.main(["kernel", "--small"]) == 0
    printed = capsys.readouterr().out
    assert "closed loop, base model / C" in printed
    assert "FAILED" not in printed
    assert printed.count("not tested") == 6
    assert printed.count(" ok") == 2


def test_an_error_above_its_limit_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    figures = [simulate.Figure("error", 11.0, 10.0, is_time=False), simulate.Figure("time", 9.0, 1.0)]
    monkeypatch.setattr(simulate, "measure", lambda size: figures[1:])
    assert simulate.main(["kernel", "--small"]) == 0
    assert simulate.main(["kernel"]) == 1
    monkeypatch.setattr(simulate, "measure", lambda size: figures)
    assert simulate.main(["kernel", "--small"]) == 1
