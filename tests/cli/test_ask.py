"""``pneucli init --ask``: questions on the terminal, asked again where an answer cannot be taken."""

from pathlib import Path

import numpy as np
import pytest
import typer

from pneucli.cli.commands import init as command

SAID = ["7 kg", "6 bar gauge", "32 mm", "40 mm", "0", "", "stop"]


def test_an_answer_that_cannot_be_taken_is_asked_for_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    time = 0.001 * np.arange(1000)
    columns = [time, np.sign(np.sin(9 * time)), 4 + np.sin(9 * time), 4 - np.sin(9 * time), 80 + 50 * np.cos(9 * time)]
    np.savetxt(
        tmp_path / "a.csv", np.column_stack(columns), delimiter=",", header="t [s],U [V],P1 [bar],P2 [bar],x [mm]"
    )
    said = iter(SAID)
    monkeypatch.setattr(typer, "prompt", lambda *_, **__: next(said))
    command._init(tmp_path / "p", [tmp_path / "a.csv"], None, False, 0, None, None, True)
    text = (tmp_path / "p" / "pipeline.toml").read_text(encoding="utf-8")
    assert 'supply_pressure = "6 bar gauge"' in text
    assert text.count('= "8.04248 cm^2"') == 2
    assert 'stroke = "? mm"' in text
    told = capsys.readouterr().err
    assert '"7 kg" has not the dimension of Pa' in told
    assert "less than the bore, 32 mm" in told
    assert next(said) == "stop"
