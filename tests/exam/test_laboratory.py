"""What a laboratory hands over: takes, files, a pipeline file, the conditions of all, and exams like one's bench."""

import json
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.exam import cases, workflow
from pneucli.exam.cases import generate_case, plan_cases, write_exam
from pneucli.exam.conditions import CONDITIONS, WIDE_CHOICES, Conditions, parse
from pneucli.exam.from_pipeline import UserRecording, UserRig, excitation_for, summarize, with_hidden_effect, write_like
from pneucli.exam.graded_case import GradedCase
from pneucli.exam.hidden_effects import BY_NAME, CATALOGUE, SIDES, UNCATALOGUED
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.excitations import closed_loop, two_sine_reference, valve_staircase
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors, measure
from pneucli.exam.rig.simulation import Excitation, simulate_rig
from pneucli.physics.effects import catalogue
from pneucli.simulate.rig_quantities import rig_quantities
from tests.exam.chosen import Chosen
from tests.exam.written import columns, rows
from tests.simulate.synthetic_experiments import model

PAR = Parameters(overlap=0.25, effective_area=2e-6, exponent=1.2)
RNG = np.random.default_rng

pytestmark = pytest.mark.usefixtures("a_quarter")


# --- manoeuvres


def test_a_reference_wanders_about_the_middle_and_within_the_stroke() -> None:
    paths = np.array([two_sine_reference(RNG(seed), 8000) for seed in range(60)])
    assert np.all(paths[:, 0] == 0.1)
    assert paths.min() >= 0.015
    assert paths.max() <= 0.185
    assert np.ptp(paths, axis=1).min() > 0.08
    assert {np.sign(path[200] - 0.1) for path in paths} == {-1.0, 1.0}
    # what is fast is slow enough to be followed: half a metre a second
    assert np.abs(np.diff(paths, axis=1)).max() < 0.5e-3
    turns = [np.count_nonzero(np.diff(np.sign(path - 0.1))) for path in paths]
    assert min(turns) >= 3
    assert max(turns) <= 30


# --- sensors


def readings(par: Parameters, sensors: Sensors, **truth: np.ndarray) -> dict[str, np.ndarray]:
    n = 1000
    whole = {name: np.zeros(n) for name in ("u", "u2", "x", "a")} | {
        p: np.full(n, par.ambient) for p in ("p1", "p2", "p_supply")
    }
    return measure(par, sensors, whole | truth, RNG(1))


QUIET = Sensors(pressure=0.0, acceleration=0.0, position_step=0.0)


def test_an_ideal_sensor_reads_the_true_gauge_pressure() -> None:
    ramp = np.linspace(0.0, 1.0, 1000)
    seen = readings(PAR, QUIET, u=ramp, x=ramp, a=ramp, p1=2e5 + ramp, p2=3e5 + ramp, p_supply=7e5 + ramp)
    for name, offset in (("u", 0.0), ("x", 0.0), ("a", 0.0), ("p1", 2e5), ("p2", 3e5), ("p_supply", 7e5)):
        assert seen[name] == pytest.approx(ramp + offset - (PAR.ambient if offset else 0.0))


def test_only_p1_has_the_offset_and_the_curve_and_both_have_the_scale() -> None:
    par = PAR._replace(pressure_offset=1e3, pressure_curvature=1e-7, pressure_scale=1.1)
    seen = readings(par, QUIET, p1=np.full(1000, par.ambient + 1e5), p2=np.full(1000, par.ambient + 1e5))
    assert seen["p1"][0] == pytest.approx(1.1e5 + 1e3 + 1e-7 * 1.1e5**2)
    assert seen["p2"][0] == pytest.approx(1.1e5)


def test_positions_are_counted_in_steps_and_acceleration_is_noisy() -> None:
    seen = readings(PAR, Sensors(pressure=0.0, acceleration=0.3, position_step=1e-4), x=np.linspace(0.0, 1e-2, 1000))
    assert seen["x"] / 1e-4 == pytest.approx(np.round(seen["x"] / 1e-4), abs=1e-9)
    assert np.unique(seen["x"]).size == 101
    assert np.std(seen["a"]) == pytest.approx(0.3, rel=0.1)


def test_each_pressure_sensor_has_its_own_noise_and_hum_of_50_hz() -> None:
    seen = readings(PAR, Sensors(pressure=100.0, pole=0.5, hum=300.0))
    for name in ("p1", "p2", "p_supply"):
        spectrum = 2 * np.abs(np.fft.rfft(seen[name])) / 1000
        assert int(np.argmax(spectrum)) == 50
        assert spectrum[50] == pytest.approx(300.0, rel=0.1)
        assert np.std(seen[name]) == pytest.approx(np.hypot(100.0, 300.0 / 2**0.5), rel=0.1)
    assert abs(np.corrcoef(seen["p1"] - seen["p2"], seen["p_supply"])[0, 1]) < 0.99
    assert Sensors() == Sensors(400.0, 0.0, 0.0, 1e-6, 0.05)


# --- the pipeline file


def pipeline(laboratory: Laboratory, *takes: RecordingPlan) -> dict:
    return tomllib.loads(laboratory.pipeline(takes, "raw"))


def test_a_recording_is_simulated_on_its_own_rig(tmp_path: Path) -> None:
    par = PAR._replace(piston_area_1=8e-4)
    lab = Laboratory("b", par, Sensors(pressure=0.0), vessel_volume=160e-6, supply_recorded=False)
    held = Excitation(np.zeros(5), pressure_1=2e5, pressure_2=2e5, position=0.05)
    lab.record(
        tmp_path, [RecordingPlan("s", "valve", "train", held), RecordingPlan("f", "friction", "test", held)], RNG(1)
    )
    valve, friction = ((tmp_path / f"{n}.csv").read_text().splitlines() for n in "sf")
    assert valve[2] == "t [ms],U_valve [V],P1 [bar]"
    assert friction[2] == "t [ms],P1 [bar],P2 [bar],Pos [mm],Acc [m/s2]"
    assert friction[3].startswith("0.0,0.987,0.987,50.0,")
    assert len(valve) == 8


# --- what is hidden


def test_every_effect_of_the_catalogue_is_hidden_in_its_own_names_and_units() -> None:
    """The truth names the declared parameters, within the declared bounds."""
    assert {e.name for e in CATALOGUE} == set(catalogue())
    facts = rig_quantities(model())
    for effect in CATALOGUE:
        told = effect.true_parameters(effect.apply(Parameters(), 1.0, RNG(4)))
        every = catalogue()[effect.name].parameters
        declared = {p.name: p for p in every if p.value_unrefined in (None, p.null)}  # the others are further laws
        assert set(told) == set(declared)
        for parameter, value in told.items():
            size = declared[parameter].range_on(facts)
            assert size.lower <= value <= size.upper, (effect.name, parameter)


def test_a_rig_hides_nothing_unless_it_is_set_to() -> None:
    plain, absent = Parameters(), {"drop": -1.0}  # a drop of 0 beside Stribeck friction takes its rise from a branch
    for effect in CATALOGUE + UNCATALOGUED:
        for field, null in effect.null_values.items():
            assert getattr(plain, field) == (0.0 if effect.inverse else absent.get(field, null)), field
    assert plain.heat_conductance < 0.0  # a constant temperature
    assert (plain.viscous_asymmetry, plain.cushion_length, plain.load_gap) == (0.0, 0.0, 0.0)


# --- cases


def test_a_refusal_names_the_rigs_on_which_an_effect_is_visible(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'(?s)"stribeck" does not show on the rig "valve".*friction or axis'):
        cases.generate_case(tmp_path, "valve", ["stribeck"], "", 1.0, 1)
    with pytest.raises(InputError, match=r'(?s)no effect "stribek".*an effect that the rig can hide.*stribeck'):
        cases.generate_case(tmp_path, "axis", ["stribek"], "", 1.0, 1)


# --- conditions of an exam: how they are named, what they change, and that each case tells which held


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


# --- an exam like one's own bench: sizes that fit the rig, manoeuvres that follow the recordings, and the page


TIME = np.arange(0.0, 3.0, 2e-3)
MOVED = UserRecording("driven", "friction", "train", TIME, 0.1 + 0.04 * np.sin(3.0 * TIME), (3e5, 3e5))
BENCH = UserRig("", Parameters(coulomb=30.0, mass=1.0), Sensors(), has_cylinder=True, recordings=(MOVED,))
TWICE = replace(BENCH, parameters=BENCH.parameters._replace(piston_area_1=16e-4, piston_area_2=16e-4))


def test_hidden_effects_are_scaled_to_the_rig() -> None:
    draw = Chosen(0.5)
    force = [with_hidden_effect(b, BY_NAME["constant-force"], 1.0, draw).constant_force for b in (BENCH, TWICE)]  # type: ignore[arg-type]
    assert force[1] == pytest.approx(2.0 * force[0])
    stribeck = with_hidden_effect(BENCH, BY_NAME["stribeck"], 1.0, draw)  # type: ignore[arg-type]
    assert stribeck.static == pytest.approx(1.85 * 30.0)
    assert stribeck.coulomb == 30.0
    small, large = (with_hidden_effect(BENCH, BY_NAME["extra-mass"], s, draw).extra_mass for s in (0.1, 1.0))  # type: ignore[arg-type]
    assert (small, large) == pytest.approx((0.06, 0.6))


def test_the_rig_moves_about_as_the_recording_did() -> None:
    truth = simulate_rig(BENCH.parameters, excitation_for(BENCH, MOVED))
    wanted = np.interp(1e-3 * np.arange(truth["x"].size), TIME, MOVED.signal)
    assert np.std(truth["x"]) > 0.3 * np.std(wanted)
    assert abs(np.mean(truth["x"] - wanted)) < 0.02


def test_a_valve_test_repeats_the_commands() -> None:
    steps = UserRecording("step", "valve", "train", TIME, np.where(TIME < 0.2, 0.0, 5.0), (1e5, 1e5))
    done = excitation_for(BENCH, steps)
    assert (done.command[100], done.command[-1]) == (0.0, 5.0)
    assert done.pressure_1 == 1e5


def test_cases_have_the_users_recordings_and_sealed_effects_and_sizes(tmp_path: Path) -> None:
    names = write_like(tmp_path / "exam", BENCH, sizes=(1.0,), repeats=1, nulls=1)
    truths = [json.loads((tmp_path / "exam" / ".sealed" / f"{n}.json").read_text()) for n in names]
    hidden = [effect for t in truths for effect in t["hidden"]]
    assert len(hidden) == len(set(hidden)) == len(names) - 1
    assert not {"valve-lag", "force-skew"} & set(hidden)  # no valve, and no recorded force
    case = tomllib.loads((tmp_path / "exam" / names[0] / "pipeline.toml").read_text())
    assert [r["name"] for r in case["recordings"]] == ["driven"]
    with pytest.raises(InputError, match="not empty"):
        write_like(tmp_path / "exam", BENCH)


def case(name: str, size: float, *missing: str) -> GradedCase:
    truth = {"hidden": {name: {}} if name else {}, "outside_the_catalogue": None, "size": size}
    return GradedCase("c", truth, {"missing": list(missing), "verdict": "", "candidates": []})


def test_the_smallest_named_size_is_named_in_nine_of_ten_cases() -> None:
    small = [case("stribeck", 0.1, "stribeck"), case("stribeck", 0.1, "presliding")]
    found = summarize([*small, *[case("stribeck", 1.0, "stribeck")] * 3, case("", 0.0), case("", 0.0, "dead-volume")])
    (row,) = found.effects
    assert (row.named_from, [s.share for s in row.sizes]) == (1.0, [0.5, 1.0])
    assert (found.false_alarms, found.nulls) == (1, 2)
    text = found.page((0.1, 1.0))
    assert "| stribeck | × 1 | 1 of 2 | 3 of 3 | presliding |" in text
    assert "1 of 2 named something" in text
    assert summarize([case("stribeck", 1.0)]).effects[0].named_from is None


# --- every effect that an exam may hide changes what is recorded, in proportion to its size, and vanishes at size zero


# no heat-transfer: it is not nested; the model without it has a constant temperature instead
SCALED = [effect for effect in CATALOGUE + UNCATALOGUED if effect.null_values]


@cache  # without an effect it is the same for most of them
def recorded(par: Parameters, kind: str) -> dict[str, np.ndarray]:
    if kind == "valve":
        par = par._replace(piston_area_1=0.0, piston_area_2=0.0, dead_volume_1=160e-6)
        return measure(par, QUIET, simulate_rig(par, valve_staircase(par, 0.5, 2.0)), np.random.default_rng(0))
    reference = two_sine_reference(np.random.default_rng(1), 2000)
    return measure(par, QUIET, simulate_rig(par, closed_loop(par, reference, 150.0, 1.8e5)), np.random.default_rng(0))


def change(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> float:
    """Largest change, in units of the noise of ordinary sensors (400 Pa, 0.05 m/s^2, 10 um)."""
    pressure = max(np.max(np.abs(one[p] - other[p])) / 400.0 for p in ("p1", "p2"))
    return max(pressure, np.max(np.abs(one["a"] - other["a"])) / 0.05, np.max(np.abs(one["x"] - other["x"])) / 1e-5)


@pytest.mark.parametrize("effect", SCALED, ids=lambda e: e.name)
def test_an_effect_is_visible_at_full_size_and_not_at_almost_none(effect):
    par = Parameters(overlap=0.0 if effect.name == "valve-deadband" else 0.2, switching=effect.name == "switching-time")
    for kind in set(effect.kinds) - {"friction"}:
        without = recorded(par, kind)
        assert change(recorded(effect.apply(par, 1.0, np.random.default_rng(2)), kind), without) > 5.0
        if not effect.inverse:
            tiny = change(recorded(effect.apply(par, 1e-9, np.random.default_rng(2)), kind), without)
            assert tiny < 0.5, kind
