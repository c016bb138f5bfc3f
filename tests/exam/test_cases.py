"""An exam: what it writes, what it keeps sealed, and how answers are graded."""

import json
import tomllib

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.exam import workflow
from pneucli.exam.cases import case_truth, generate_case, plan_cases, write_exam
from pneucli.exam.conditions import Conditions
from pneucli.exam.grading import grade
from pneucli.exam.hidden_effects import BY_NAME, ON_A_SIDE
from pneucli.exam.laboratory import Laboratory
from pneucli.exam.rig.parameters import TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.physics.effects import catalogue
from pneucli.physics.sides import with_variants
from tests.exam.written import rows

pytestmark = pytest.mark.usefixtures("a_quarter")


def test_a_case_has_the_files_of_a_laboratory_and_reveals_nothing(tmp_path):
    truth = generate_case(tmp_path / "case-001", "valve", ["valve-lag"], "", 1.0, 7)
    files = sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file())
    pipeline = tomllib.loads((tmp_path / "case-001" / "pipeline.toml").read_text())
    assert len(files) == 1 + len(pipeline["recordings"])
    assert {r["use"] for r in pipeline["recordings"]} == {"train", "test"}
    assert not any("lag" in (tmp_path / f).read_text() for f in files)
    assert truth["verdict"] == "missing-effect"


@pytest.mark.parametrize(
    ("kind", "hidden"), [("friction", ["stribeck"]), ("axis", ["supply-droop"]), ("axis", ["valve-deadband"])]
)
def test_the_pipeline_file_has_the_signals_that_the_effect_needs(tmp_path, kind, hidden):
    generate_case(tmp_path / "case", kind, hidden, "", 1.0, 8)
    pipeline = tomllib.loads((tmp_path / "case" / "pipeline.toml").read_text())
    assert ("p_supply" in pipeline["signals"]) <= (hidden != ["supply-droop"])
    assert (pipeline["model"].get("valve") == "linear") >= (hidden == ["valve-deadband"])
    for recording in pipeline["recordings"]:
        table = rows(tmp_path / "case" / recording["file"])
        assert np.all(np.isfinite(table))


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


def test_the_truth_has_the_hidden_effects_and_the_rig():
    (hidden,) = [e for e in BY_NAME.values() if e.name == "extra-mass"]
    truth = case_truth(laboratory(), [hidden], "", Conditions())
    base = {
        "coulomb": 15.0, "viscous": 50.0, "effective_area_at_10V": 2e-6, "overlap_V": 0.2, "area_exponent": 1.1,
        "critical_ratio": 0.4, "null_V": 0.0, "fully_open_V": 10.0,
    }  # fmt: skip
    assert truth == {
        "hidden": {"extra-mass": hidden.true_parameters(laboratory().parameters)},
        "outside_the_catalogue": None,
        "baseline": ["stribeck"],
        "baseline_parameters": {"stribeck": {"static": 0.0, "velocity": 0.01}},
        "command_sets_area": True,
        "part": None,
        "over": None,
        "conditions": ["usual"],
        "verdict": "missing-effect",
        "unexplained_is_right": False,
        "base": base,
        "sensor_noise_pressure_Pa": 300.0,
    }
    assert case_truth(laboratory(), [], "", Conditions())["verdict"] == "adequate"
    second = {"effective_area_2": 3e-6, "overlap_2": 0.1, "exponent_2": 1.3}
    two = case_truth(laboratory(arrangement=TWO_VALVES, **second), [], "", Conditions())
    more = {"effective_area_2_at_10V": 3e-6, "overlap_2_V": 0.1, "area_exponent_2": 1.3}
    assert two["base"] == base | more


def test_the_truth_of_a_disturbance_states_its_location():
    stranger = next(e for e in BY_NAME.values() if not e.fields)
    truth = case_truth(laboratory(), [stranger], stranger.name, Conditions(names=("narrow",)))
    assert (truth["outside_the_catalogue"], truth["verdict"]) == (stranger.name, "unexplained")
    assert (truth["part"], truth["over"]) == (stranger.part, stranger.variable)
    assert (truth["conditions"], truth["unexplained_is_right"]) == (["narrow"], True)


def _seal(folder, case, hidden, outside=None):
    verdict = "unexplained" if outside else "missing-effect" if hidden else "adequate"
    (folder / ".sealed").mkdir(parents=True, exist_ok=True)
    truth = {"hidden": hidden, "outside_the_catalogue": outside, "verdict": verdict}
    (folder / ".sealed" / f"{case}.json").write_text(json.dumps(truth))


def test_a_broken_answer_names_file_and_line(tmp_path):
    _seal(tmp_path, "a", {})
    (tmp_path / "answers").mkdir()
    (tmp_path / "answers" / "a.json").write_text('{"verdict":\n oops}')
    with pytest.raises(InputError, match=r"a\.json, line 2"):
        grade(tmp_path, tmp_path / "answers")


def test_a_folder_without_truths_is_refused(tmp_path):
    with pytest.raises(InputError, match="no sealed truths"):
        grade(tmp_path, tmp_path)


def test_the_rig_hides_the_whole_catalogue_and_more():
    assert {e.name for e in BY_NAME.values() if e.fields} == set(catalogue())
    assert {e.name for e in ON_A_SIDE} == with_variants(catalogue().values()).keys() - set(catalogue())
    assert len([e for e in BY_NAME.values() if not e.fields]) >= 8
