"""``leak``: pass, fail and undecided in the exit code, all units in the answer, and the page."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.identify.test_leak_test import decay

from .conftest import Command

RATE = 500.0  # Pa/s


@pytest.fixture
def tank(tmp_path: Path) -> Path:
    time, pressure = decay(RATE, "orifice", seconds=60.0, noise=100.0)
    p = pressure / 1e5
    path = tmp_path / "decay.csv"
    rows = "".join(f"{t:.2f},{one:.5f}\n" for t, one in zip(time, p, strict=True))
    path.write_text(f"t [s],p1 [bar(a)]\n{rows}", encoding="utf-8")
    return path


def test_the_answer_is_in_the_units_of_the_trade(pneucli: Command, tank: Path) -> None:
    answer = json.loads(pneucli("leak", tank, "--volume", "2 l", "--json").out)
    (one,) = answer["tests"]
    assert one["rate"]["ci95"][0] < RATE < one["rate"]["ci95"][1]
    litres = 2e-3 * one["rate"]["value"] / (287.0 * 293.15) / 1.185 * 60e3
    assert one["flow"]["value"] == pytest.approx(litres, rel=1e-3)
    assert one["flow"]["unit"] == "l/min ANR"
    assert one["throughput"]["value"] == pytest.approx(2e-3 * one["rate"]["value"])
    assert one["area"]["value"] == pytest.approx(
        one["throughput"]["value"] / (287 * 293.15) / (7e5 * 2.361e-3), rel=0.01
    )
    assert answer["verdict"] is None


@pytest.mark.parametrize(
    ("limit", "verdict", "code"),
    [
        ("600 Pa/s", "pass", 0),
        ("0.4 l/min", "fail", 1),
        ("0.8 l/min ANR", "pass", 0),
        ("15 mbar l/s", "pass", 0),
        ("0.002 mm^2", "fail", 1),
        ("500 Pa/s", "undecided", 1),
    ],
)
def test_the_exit_code_says_whether_it_passes(
    pneucli: Command, tank: Path, limit: str, verdict: str, code: int
) -> None:
    done = pneucli("leak", tank, "--volume", "2 l", "--limit", limit, "--json")
    assert (json.loads(done.out)["verdict"], done.code) == (verdict, code)


def test_an_undecided_test_says_how_long_one_would_decide(pneucli: Command, tank: Path) -> None:
    shown = pneucli("leak", tank, "--volume", "2 l", "--limit", "500 Pa/s").out
    assert "cannot be decided: the limit is within the interval" in " ".join(shown.split())
    assert "would decide" in shown


def test_a_page_has_the_curve(pneucli: Command, tank: Path, tmp_path: Path) -> None:
    page = tmp_path / "leak.html"
    assert pneucli("leak", tank, "--volume", "2 l", "--limit", "1 l/min", "--html", page).code == 0
    text = page.read_text(encoding="utf-8")
    assert "<svg" in text
    assert "passes" in text


def test_a_rate_needs_no_volume_and_a_flow_does(pneucli: Command, tank: Path) -> None:
    assert pneucli("leak", tank, "--limit", "600 Pa/s").code == 0
    refused = pneucli("leak", tank, "--limit", "0.5 l/min")
    assert refused.code == 2
    assert '--volume "2 l"' in refused.err


@pytest.mark.parametrize("words", [("--volume", "2 kg"), ("--volume", "-2 l"), ("--limit", "0.5"), ("--limit", "3 K")])
def test_what_is_no_quantity_is_refused(pneucli: Command, tank: Path, words: tuple[str, str]) -> None:
    done = pneucli("leak", tank, *words)
    assert done.code == 2
    assert words[0] in done.err
    assert "E001" in done.err


def test_a_pipeline_file_states_volume_and_command(pneucli: Command, tank: Path) -> None:
    pipeline = tank.with_name("rig.toml")
    pipeline.write_text(
        '[pipeline]\nname = "tank"\n[rig.vessel]\nvolume = "3 l"\n[signals]\ntime = { column = "t [s]", unit = "s" }\n'
        'p1 = { column = "p1 [bar(a)]", unit = "bar" }\n'
        '[[recordings]]\nfile = "decay.csv"\nexperiment = "valve"\nuse = "train"\nvalve = "shut"\n',
        encoding="utf-8",
    )
    assert json.loads(pneucli("leak", pipeline, "--json").out)["volume"] == pytest.approx(3e-3)


def test_a_vessel_at_ambient_cannot_leak(pneucli: Command, tank: Path) -> None:
    lines = tank.read_text(encoding="utf-8").splitlines()
    noise = 1.013 + 1e-3 * np.random.default_rng(4).standard_normal(len(lines) - 1)
    flat = [lines[0], *(f"{line.split(',')[0]},{one:.5f}" for line, one in zip(lines[1:], noise, strict=True))]
    tank.write_text("\n".join(flat), encoding="utf-8")
    done = pneucli("leak", tank, "--volume", "2 l")
    assert done.code == 2
    assert "nowhere does a shut vessel lose pressure" in done.err
