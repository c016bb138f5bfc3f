"""False data sets are found out, and good ones are left alone."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pneucli import messages
from pneucli.config import load
from pneucli.figure import read
from pneucli.messages.ingest import Answer, SignalSummary, implausibility_sentences
from pneucli.pipeline.graph import Context
from pneucli.stages import ingest
from tests.plausibility.faulty_data_sets import BASES, EXPLAINED, P1, PS, SETS, Rig, T, U, looked_at, told


@pytest.mark.parametrize("name", SETS)
def test_a_false_data_set_is_found_out(name: str, tmp_path: Path) -> None:
    answer = looked_at(SETS[name].make(noise=True), tmp_path)
    assert SETS[name].expected <= told(answer), answer["plausibility"]
    assert all(
        one["found"] and one["mend"] and one["recording"] and one["excess"] > 0 for one in answer["plausibility"]
    )


@pytest.mark.parametrize("base", BASES)
def test_a_good_data_set_is_left_alone(base: str, tmp_path: Path) -> None:
    assert looked_at(Rig.of(base, noise=True), tmp_path)["plausibility"] == []


@pytest.mark.parametrize("name", EXPLAINED)
def test_what_an_effect_explains_is_left_alone(name: str, tmp_path: Path) -> None:
    base, change = EXPLAINED[name]
    assert looked_at(change(Rig.of(base, noise=True)), tmp_path)["plausibility"] == []


HELD = ('name = "driven_2"', 'name = "driven_2"\nx = "100 mm"\ntake = ["time", "p1", "p2"]')


def test_a_piston_that_is_held_may_be_stated_so(tmp_path: Path) -> None:
    rig = Rig.of("friction", noise=True)
    held = replace(rig, text=rig.text.replace(*HELD))
    assert held.text != rig.text
    assert looked_at(held, tmp_path)["plausibility"] == []


def test_a_small_leak_at_a_shut_valve_needs_no_valve(tmp_path: Path) -> None:
    """A chamber of 160 cm^3 that loses 1 mbar/s: 1e-10 m^2, at a command that is stated."""
    rows = [f"{t},0.0,6.0,{5.0 - 1e-5 * t + 1e-3 * (t % 3):.6f}" for t in range(3000)]
    leak = SETS["valve, u dead"].make(noise=True)
    head, table = leak.text.split("[[recordings]]")[:2]
    (tmp_path / "leak.csv").write_text(f"{T},{U},{PS},{P1}\n" + "\n".join(rows))
    table = table.replace("step_+3.0V", "leak").replace('use = "test"', 'use = "train"')
    (tmp_path / "leak.toml").write_text(f"{head}[[recordings]]{table}")
    assert plausibility(tmp_path / "leak.toml", tmp_path / "out") == []


def test_people_read_the_table_of_signals_and_what_is_implausible(tmp_path: Path) -> None:
    answer = looked_at(SETS["friction, p2 alone gauge read as absolute"].make(noise=True), tmp_path)
    json.dumps(answer, allow_nan=False)
    assert answer["looks"]["driven_1"]["x"].keys() == vars(SignalSummary("m", *[0.0] * 7)).keys()
    text = messages.render("ingest", answer, "p.toml").splitlines()
    assert [line.split()[-3:-1] for line in text if line.split()[:2] == ["friction", "p2"]] == [["bar", "1000"]]
    first, second = implausibility_sentences(read(Answer, answer).plausibility)
    assert first.startswith("stickslip_2, p2 rests at 0 bar in an open chamber: gauge?")
    assert second.startswith("driven_1 and 1 more, p2 of the closed chamber lacks ambient pressure at")
    assert first.endswith('; write reference = "gauge" in [signals] p2')
    assert answer["findings"] == {"contradictions": 1, "doubts": 2}


def plausibility(path: Path, out: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = ingest.run(Context(path, load(path), out / "ingest", out))["plausibility"]
    return found
