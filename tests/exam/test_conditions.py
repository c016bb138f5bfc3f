"""Conditions of an exam: how they are named, what they change, and that each case tells which held."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.exam.cases import generate_case, write_exam
from pneucli.exam.conditions import CONDITIONS, listed, parse


def test_names_joined_by_plus_hold_at_once():
    both = parse("bore-6mm+rate-200Hz")
    assert (both.bore, both.rate, both.supply) == (pytest.approx(6e-3), 200.0, None)
    assert both.names == ("bore-6mm", "rate-200Hz")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("bore-5mm", "from 6 to 200"),
        ("rate-50Hz", "from 100 to 10000"),
        ("bore-6mm+bore-8mm", "one condition for bore"),
        ("rat-200Hz", 'did you mean "rate-#Hz"'),
        ("rate-Hz", "is a number"),
        ("", "one of usual"),
    ],
)
def test_what_is_no_condition_is_refused_with_what_would_be(name, words):
    with pytest.raises(InputError, match=words):
        parse(name)


def test_the_help_lists_every_condition():
    assert all(condition.form in listed() and condition.about in listed() for condition in CONDITIONS)


def test_the_recordings_and_the_pipeline_file_are_of_that_size_and_rate(tmp_path):
    generate_case(tmp_path / "case", "axis", [], "", 1.0, 5, parse("bore-6mm+supply-3bar+rate-200Hz"))
    pipeline = tomllib.loads((tmp_path / "case" / "pipeline.toml").read_text())
    cylinder = pipeline["rig"]["cylinder"]
    assert float(cylinder["piston_area_1"].split()[0]) == pytest.approx(np.pi / 4 * 0.6**2, rel=1e-3)  # cm^2
    assert float(cylinder["moving_mass"].split()[0]) < 0.1  # kg
    assert pipeline["rig"]["supply_pressure"].startswith("3.0")
    table = np.genfromtxt(tmp_path / "case" / "raw" / "axis_1.csv", delimiter=",", skip_header=3)
    assert np.diff(table[:, 0]) == pytest.approx(5.0)  # ms
    assert 0.0 < table[:, -2].min() < table[:, -2].max() < float(cylinder["stroke"].split()[0])


def test_conditions_are_recorded_sealed_and_get_the_same_rigs(tmp_path):
    names = ["usual", "rate-200Hz", "bore-50mm+supply-12bar"]
    write_exam(tmp_path / "exam", cases=2, nulls=1, seed=3, conditions=names)
    truths = [json.loads(path.read_text()) for path in sorted((tmp_path / "exam" / ".sealed").glob("case-*.json"))]
    of = {n: [t for t in truths if t["conditions"] == n.split("+")] for n in names}
    assert [len(cases) for cases in of.values()] == [3, 3, 3]
    assert {frozenset(frozenset(t["hidden"]) for t in cases) for cases in of.values()} == {
        frozenset(frozenset(t["hidden"]) for t in of["usual"])
    }
    # what a rig is does not depend on how it is logged
    assert sorted(t["base"]["coulomb"] for t in of["usual"]) == sorted(t["base"]["coulomb"] for t in of["rate-200Hz"])
