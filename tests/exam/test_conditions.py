"""Conditions of an exam: how they are named, what they change, and that each case tells which held."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.exam import workflow
from pneucli.exam.cases import generate_case, plan_cases, write_exam
from pneucli.exam.conditions import CONDITIONS, WIDE_CHOICES, Conditions, parse
from pneucli.exam.hidden_effects import BY_NAME, CATALOGUE, SIDES, UNCATALOGUED
from pneucli.exam.laboratory import Laboratory
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors
from tests.exam.written import columns, rows

pytestmark = pytest.mark.usefixtures("a_quarter")


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
def test_an_unknown_condition_is_refused_with_the_valid_ones(name, words):
    with pytest.raises(InputError, match=words):
        parse(name)


@pytest.mark.parametrize(
    ("form", "low", "high"),
    [("bore-{}mm", 6, 200), ("supply-{}bar", 3, 50), ("rate-{}Hz", 100, 10_000), ("bits-{}", 8, 16)],
)
def test_a_number_lies_within_its_limits(form, low, high):
    for at_limit in (low, high):
        parse(form.format(at_limit))
    for beyond in (low - 0.1, high + 0.1):
        with pytest.raises(InputError) as error:
            parse(form.format(beyond))
        assert error.value.wanted == f"{form.format('#')} with # from {low:g} to {high:g}"
        assert (error.value.where, error.value.found) == ("--condition", form.format(beyond))


def test_conditions_of_different_rigs_exclude_each_other():
    with pytest.raises(InputError) as error:
        parse("tank+differential")
    assert (error.value.where, error.value.found) == ("--condition", "tank+differential")
    assert error.value.wanted == "conditions that hold on one kind of rig"
    assert parse("no-acceleration+no-p2").absent == {"a", "p2"}


def test_the_recordings_and_the_pipeline_file_are_of_that_size_and_rate(tmp_path):
    truth = generate_case(tmp_path / "case", "axis", [], "", 1.0, 5, parse("bore-6mm+supply-3bar+rate-200Hz"))
    assert truth["conditions"] == ["bore-6mm", "supply-3bar", "rate-200Hz"]
    pipeline = tomllib.loads((tmp_path / "case" / "pipeline.toml").read_text())
    cylinder = pipeline["rig"]["cylinder"]
    assert float(cylinder["piston_area_1"].split()[0]) == pytest.approx(np.pi / 4 * 0.6**2, rel=1e-3)  # cm^2
    assert float(cylinder["moving_mass"].split()[0]) < 0.1  # kg
    assert pipeline["rig"]["supply_pressure"].startswith("3.0")
    table = rows(tmp_path / "case" / "raw" / "axis_1.csv")
    assert np.diff(table[:, 0]) == pytest.approx(5.0)  # ms
    assert 0.0 < table[:, -2].min() < table[:, -2].max() < float(cylinder["stroke"].split()[0])


def test_conditions_are_recorded_sealed_and_get_the_same_rigs(tmp_path):
    names = ["usual", "rate-200Hz"]
    write_exam(tmp_path / "exam", cases=1, nulls=0, seed=3, conditions=names)
    truths = [json.loads(path.read_text()) for path in sorted((tmp_path / "exam" / ".sealed").glob("case-*.json"))]
    of = {n: [t for t in truths if t["conditions"] == n.split("+")] for n in names}
    assert [len(cases) for cases in of.values()] == [1, 1]
    assert {frozenset(frozenset(t["hidden"]) for t in cases) for cases in of.values()} == {
        frozenset(frozenset(t["hidden"]) for t in of["usual"])
    }
    # what a rig is does not depend on how it is logged
    assert sorted(t["base"]["coulomb"] for t in of["usual"]) == sorted(t["base"]["coulomb"] for t in of["rate-200Hz"])


def _conditions(folder, kind, name, seed=5, hidden=()):
    truth = generate_case(folder, kind, list(hidden), "", 1.0, seed, parse(name))
    return truth, tomllib.loads((folder / "pipeline.toml").read_text())


def test_messy_cases_have_small_disturbances_and_may_be_unexplained(tmp_path):
    truth, _ = _conditions(tmp_path / "a", "axis", "messy", hidden=["extra-mass"])
    clean, _ = _conditions(tmp_path / "b", "axis", "usual", hidden=["extra-mass"])
    assert 3 <= len(truth["mess"]) <= 4
    assert all(BY_NAME[name] in UNCATALOGUED and size <= 0.25 for name, size in truth["mess"].items())
    assert truth["hidden"] == clean["hidden"]  # the same rig
    assert (truth["verdict"], truth["unexplained_is_right"]) == ("missing-effect", True)
    assert (clean["mess"], clean["unexplained_is_right"]) == ({}, False)
    table, pure = (rows(tmp_path / n / "raw" / "axis_1.csv") for n in "ab")
    assert np.std(table[:, 3] - pure[:, 3]) > 0.005  # bar: more than the noise


def test_a_healthy_rig_may_be_messy_too(tmp_path):
    write_exam(tmp_path / "exam", cases=0, nulls=1, seed=2, conditions=["messy"])
    truths = [json.loads(path.read_text()) for path in (tmp_path / "exam" / ".sealed").glob("case-*.json")]
    assert all(t["verdict"] == "adequate" and t["mess"] and not t["hidden"] for t in truths)


@pytest.mark.parametrize("bits", [8, 12])
def test_converters_leave_so_many_steps(tmp_path, bits):
    _, pipeline = _conditions(tmp_path / "case", "axis", f"bits-{bits}")
    table = columns(tmp_path / "case" / "raw" / "axis_1.csv")
    supply = float(pipeline["rig"]["supply_pressure"].split()[0]) - 1.013
    for column, span in (("P1_[bar]", 1.25 * supply), ("Pos_[mm]", 220.0)):
        levels = np.unique(table[column])
        assert np.diff(levels).min() == pytest.approx(span / 2**bits, rel=0.05, abs=1e-5)
        assert levels.size <= 2**bits


def test_the_exam_page_lists_every_condition_and_every_disturbance():
    docs = Path(__file__).parents[2] / "docs"
    page = (docs / "exam.md").read_text()
    names = [condition.pattern.partition("#")[0] for condition in CONDITIONS]
    assert [name for name in names if f"`{name}" not in page] == []
    listed = [f"{effect.part} | {effect.variable} |" for effect in UNCATALOGUED if effect.name in page]
    assert len(listed) == len(UNCATALOGUED)
    assert all(row in page for row in listed)


def test_wide_draws_other_conditions_for_each_case_and_records_them(tmp_path):
    write_exam(tmp_path / "exam", cases=1, nulls=0, seed=2, conditions=["wide"])
    (sealed,) = (tmp_path / "exam" / ".sealed").glob("case-*.json")
    assert json.loads(sealed.read_text())["conditions"][0] == "wide"
    planned = list(plan_cases(4, 0, parse("wide"), 2))
    assert len({one.conditions.names for one in planned}) > 1
    counts = [len(one.conditions.names) - 1 for one in plan_cases(60, 20, parse("wide"), 2)]
    assert min(counts) <= 2  # what no line says is as usual
    assert max(counts) >= 6
    for one in planned:
        assert all(parse("+".join(one.conditions.names)).allows(name) for name in one.hidden)


@pytest.mark.parametrize(
    "names",
    [
        "both-sides+no-p2",
        "tank+free-b",
        "tank+hose",
        "hose+pump",
        "hose+both-sides",
        "pump+wall-heat",
        "regulated-valve+free-b",
        "pump+held-commands",
        "pump+5/3",
    ],
)
def test_conditions_that_contradict_each_other_are_refused(names):
    with pytest.raises(InputError, match="--condition"):
        parse(names)


def test_on_both_sides_every_effect_has_a_side_and_a_hose_needs_a_second_valve():
    allowed = {effect.name for effect in CATALOGUE if parse("both-sides").allows(effect.name)}
    assert allowed == set(SIDES) - {"line-delay"}
    assert parse("both-sides+5/3").allows("line-delay")
    plan = list(plan_cases(40, 0, parse("both-sides"), 3))
    named = {name for case in plan for name in case.hidden}
    assert named == {name for effect in allowed for name in SIDES[effect]}


def test_wide_draws_every_condition_that_it_can():
    seen = {
        name for seed in range(12) for case in plan_cases(20, 10, parse("wide"), seed) for name in case.conditions.names
    }
    assert seen >= {name for line in WIDE_CHOICES for name in line} - {"usual"}


# --- an exam: what it writes, what it keeps sealed, and how answers are graded


def test_a_case_has_the_files_of_a_laboratory_and_reveals_nothing(tmp_path):
    truth = generate_case(tmp_path / "case-001", "valve", ["valve-lag"], "", 1.0, 7)
    files = sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file())
    pipeline = tomllib.loads((tmp_path / "case-001" / "pipeline.toml").read_text())
    assert len(files) == 1 + len(pipeline["recordings"])
    assert {r["use"] for r in pipeline["recordings"]} == {"train", "test"}
    assert not any("lag" in (tmp_path / f).read_text() for f in files)
    assert truth["verdict"] == "missing-effect"


def test_the_same_seed_gives_the_same_case_and_another_seed_another(tmp_path):
    for name, seed in (("a/c", 1), ("b/c", 1), ("d/c", 2)):
        generate_case(tmp_path / name, "valve", [], "", 1.0, seed)
    text = {name: (tmp_path / name / "c" / "raw" / "stairs_1.csv").read_bytes() for name in "abd"}
    assert text["a"] == text["b"] != text["d"]


def test_an_exam_has_nulls_disturbances_and_pairs_and_its_names_reveal_nothing(tmp_path):
    planned = list(plan_cases(6, 2, Conditions(), 3))
    assert sorted(len(one.hidden) for one in planned) == [0, 0, 0, 1, 1, 1, 1, 2]
    assert sum(bool(one.outside) for one in planned) == 1
    workflow.write(tmp_path / "exam", cases=1, nulls=1, seed=3)
    truths = [json.loads(p.read_text()) for p in sorted((tmp_path / "exam" / ".sealed").glob("case-*.json"))]
    assert sorted(t["verdict"] for t in truths) == ["adequate", "missing-effect"]
    assert not list((tmp_path / "exam").glob("case-*/truth*"))
    with pytest.raises(InputError, match="not empty"):
        write_exam(tmp_path / "exam")


def laboratory(**changed):
    known = {"coulomb": 15.0, "viscous": 50.0, "effective_area": 2e-6, "overlap": 0.2, "exponent": 1.1}
    par = Parameters()._replace(**known, critical_ratio=0.4, **changed)
    return Laboratory(
        "bench", par, Sensors(pressure=300.0, acceleration=0.1, position_step=1e-6), effects=("stribeck",)
    )
