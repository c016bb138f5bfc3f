"""The stage ``identify`` on the example: artifacts of the interface, and the rig's true parameters found."""

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from pneucli import messages
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Estimate
from pneucli.io.artifacts import read_metadata, read_table
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.pipeline.graph import Context, NotApplicable
from pneucli.plausibility.required_inputs import RequiredInput
from pneucli.recording import ParameterPrior, Recording, Rig
from pneucli.simulate.preparation import prepare
from pneucli.stages import check, diagnose, identify, report, simulate
from pneucli.stages.identify import _smoothing_warnings, _volume_warnings
from pneucli.stages.identify_tables import MAX_TRAIN_RESIDUAL, lack_of_fit_findings, valve_findings
from pneucli.stages.init import create
from pneucli.stages.pipeline_data import require_stated
from pneucli.stages.pipeline_file import parameter_priors, with_started_supply
from tests.config.test_config import BASE, write
from tests.identify_valve.steady_bench import PIPELINE, bench_rows, write_csv
from tests.stages.chain import known_as_declared, run_stages
from tests.stages.conftest import DEMO

FIXTURES = DEMO.parents[1]
Demo = tuple[Path, dict[str, Any]]
TRUTH = json.loads((DEMO.parents[1] / "truth.json").read_text())["demo"]["parameters"]

# interface, section 4
COLUMNS = {
    "valve_map": {"u", "p", "p_gradient", "p_gradient_ci_low", "p_gradient_ci_high"},
    "valve_inverse": {"p_gradient", "p", "u", "reachable"},
    "valve_lack_of_fit": {"u", "p", "model", "measured", "difference", "outside"},
    "parameters": {"name", "value", "unit", "ci_low", "ci_high"},
    "friction_models": {"model", "branch", "v", "force"},
}


RANGE = TRUTH["command_range"]  # V from the null


def true_area(u: float, of: str = "") -> float:
    """Area in m^2 at a command from the null; ``of`` is the ending of the names of chamber 2's paths."""
    span = (abs(u) - TRUTH[f"overlap{of}"]) / (RANGE - TRUTH[f"overlap{of}"])
    return float(TRUTH[f"effective_area{of}"] * span ** TRUTH[f"exponent{of}"])


def test_friction_is_the_rigs(demo: Demo) -> None:
    found = demo[1]["identify"]["model"]["parameters"]
    expected = {
        "friction.coulomb": TRUTH["coulomb"],
        "friction.viscous": TRUTH["viscous"],
        "stribeck.static": TRUTH["static"],
        "stribeck.velocity": TRUTH["stribeck_velocity"],
        "piston-leak.area": TRUTH["piston_leak_area"],
    }
    for name, value in expected.items():
        assert found[name]["value"] == pytest.approx(value, rel=0.02), name


def test_areas_of_the_valve_are_the_rigs(demo: Demo) -> None:
    found = demo[1]["identify"]["model"]["parameters"]
    for u in (-5, -2.5, -1, -0.5, 0.5, 1, 1.75, 2.5, 3.75, 5):
        for valve, of in (("valve", ""), ("valve_2", "_2")):
            area = found[f"{valve}.effective_area({u:+.4g} V)"]
            assert area["unit"] == "m^2"
            assert area["value"] == pytest.approx(true_area(u, of), rel=0.01), (valve, u)


def test_intervals_hold_the_truth_about_as_often_as_they_say(demo: Demo) -> None:
    found = demo[1]["identify"]["model"]["parameters"]
    areas = {float(n.split("(")[1].split(" ")[0]): p for n, p in found.items() if "valve.effective_area" in n}
    held = [p["ci95"][0] < true_area(u) < p["ci95"][1] for u, p in areas.items()]
    assert np.mean(held) > 0.6  # 95 % of 14: fewer than 9 would be one case in a million


def test_artifacts_are_those_of_the_interface(demo: Demo) -> None:
    out = demo[0] / "identify"
    for name, columns in COLUMNS.items():
        assert columns <= set(pq.read_schema(out / f"{name}.parquet").names), name
        assert read_metadata(out / f"{name}.parquet")["schema"] == f"pneucli/identify/{name}/1"
    assert {p.stem for p in out.glob("tp_*.parquet")} == {"tp_weights", "tp_vertices"}
    assert set(read_table(out / "friction_models.parquet")["model"]) == set("ABCDEF")
    names = list(read_table(out / "parameters.parquet")["name"])
    for iso in ("sonic_conductance", "critical_ratio", "subsonic_index"):
        assert f"valve.{iso}(+5 V)" in names


def test_the_map_is_the_balance_of_mass_of_the_vessel(demo: Demo) -> None:
    """Choked: dp/dt = kappa sqrt(2 R T) A p_S 0.484 / V (thesis 2.42, 2.46)."""
    table = {k: np.asarray(v) for k, v in read_table(demo[0] / "identify" / "valve_map.parquet").items()}
    low = (table["chamber"] == 1) & (table["u"] > 9.99) & (table["p"] < 2.5e5) & (table["p"] > 1.5e5)
    expected = 1.4 * np.sqrt(2 * 287 * TRUTH["temperature"]) * true_area(5) * TRUTH["supply"] * 0.484 / 160e-6
    assert table["p_gradient"][low] == pytest.approx(np.full(low.sum(), expected), rel=0.02)


def test_one_valve(demo: Demo) -> None:
    """The map's own curves need nothing that the model's valve has not, and its overlap is told in one place only."""
    answer, table = demo[1]["identify"], read_table(demo[0] / "identify" / "valve_lack_of_fit.parquet")
    lack, residual = answer["valve"]["lack_of_fit"], answer["valve"]["residual"]
    assert lack["median"] < 0.005
    assert lack["p95"] < 0.03
    assert np.asarray(table["difference"]) == pytest.approx(np.asarray(table["measured"]) - np.asarray(table["model"]))
    assert residual["train"] == pytest.approx(1.0, abs=0.1)
    # 1.75 V was fitted on short stairs: an area 0.1 % off shows as 3 on its long step
    assert residual["test"] < MAX_TRAIN_RESIDUAL
    found = answer["model"]["parameters"]
    assert answer["valve"]["overlap"]["charge"] == found["valve.overlap_fill"]
    assert answer["valve"]["overlap"]["discharge"] == found["valve.overlap_vent"]
    unit = 0.484 * np.sqrt(2 / (287 * 293.15)) / 1.185
    c = answer["valve"]["iso"]["valve.sonic_conductance(+5 V)"]["value"]
    assert c == pytest.approx(unit * found["valve.effective_area(+5 V)"]["value"])


def test_what_the_model_lacks_of_the_valve_is_a_warning_with_numbers() -> None:
    lack = SimpleNamespace(is_significant=True, median=0.047, p95=0.2, share_outside=0.61)
    assert [one.text for one in lack_of_fit_findings(lack)] == [  # type: ignore[arg-type]
        "valve-lack-of-fit: the model's valve is off the measured gradients by 5 % in the median, 20 % at the 95th "
        "percentile, outside both 95 % intervals at 61 % of the points: pneucli diagnose says what it may lack"
    ]
    lack.is_significant = False
    assert not list(lack_of_fit_findings(lack))  # type: ignore[arg-type]


def test_a_map_beyond_all_measure_is_named() -> None:
    """A gradient far above what the curves themselves show, and curves that no map follows, are not passed over."""
    calm = SimpleNamespace(is_significant=False)
    valve = SimpleNamespace(
        is_consistent=False,
        max_gradient=1e13,
        max_measured_gradient=2e6,
        lack_of_fit=calm,
        iso=(),
        measured=True,
        residual_to_noise=lambda use: 7.0,
    )
    names = [code for code, _ in valve_findings(valve)]  # type: ignore[arg-type]
    assert names == ["valve-not-described", "valve-curves-not-followed"]
    valve.is_consistent, valve.residual_to_noise = True, {"train": 1.0, "test": 9.0}.__getitem__
    assert [code for code, _ in valve_findings(valve)] == ["valve-not-foreseen"]  # type: ignore[arg-type]


def test_the_answer_is_json_and_words(demo: Demo) -> None:
    answer = demo[1]["identify"]
    json.dumps(answer, allow_nan=False)
    told = messages.render("identify", answer, "demo.toml")
    assert told.startswith("found    ")
    assert re.search(r"^friction.coulomb +1[34]\.\d+ ± 0\.\d\d+ N$", told, re.MULTILINE)
    assert re.search(r"^valve +the model leaves \S+ × noise on the curves, \S+ × noise on held-out", told, re.MULTILINE)
    assert told.endswith("pneucli compare demo.toml")


def test_of_very_long_recordings_segments_are_fitted_and_the_answer_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Friction models still come from every sample."""
    path = FIXTURES / "friction_null_coulomb" / "pipeline.toml"
    whole = run_stages(path, tmp_path / "whole")["identify"]
    monkeypatch.setattr(identify, "MAX_FIT_SAMPLES", 8000)
    part = run_stages(path, tmp_path / "part")["identify"]
    (warning,) = (text for text in part["warnings"] if text not in whole["warnings"])
    assert re.match(r"8000 of \d+ samples are fitted", warning)
    assert part["friction"]["models"] == whole["friction"]["models"]
    (found, wanted) = (a["model"]["parameters"]["friction.coulomb"] for a in (part, whole))
    assert found["value"] != wanted["value"]
    assert found["value"] == pytest.approx(wanted["value"], rel=0.05)


# --- ``identify`` names the recordings whose imposed motion scatters more than the noise of its sensor


@pytest.mark.parametrize("digits", [4, 9])
def test_a_text_with_few_digits_is_named(digits: int) -> None:
    time = 2e-3 * np.arange(4000)
    x = np.array([float(f"{value:.{digits}g}") for value in np.pi * time])
    noise = {"x": NoiseModel(2e-5, period=2e-3), "force": NoiseModel(0.1, period=2e-3)}
    signals = {"x": x, "force": 20.0 + 0.1 * np.random.default_rng(0).standard_normal(time.size)}
    recording = Recording("p60", "friction", "train", time, signals, noise, imposed="motion")
    said = _smoothing_warnings([prepare(recording, Rig(), None)])
    assert [text.partition(":")[0] for text in said] == ["p60"] * (digits == 4)


# --- a stated volume of a vessel that the recorded flow contradicts


def estimate(value: float, low: float, high: float) -> list[Estimate]:
    return [Estimate("rig.vessel_volume", "m^3", value, 0.5 * (high - low), (low, high), at_bound=False)]


def test_a_stated_volume_outside_the_interval_is_reported() -> None:
    (warning,) = _volume_warnings(Rig(vessel_volume=951e-6), estimate(808e-6, 801e-6, 816e-6))
    assert "808 cm^3 [801, 816]" in warning
    assert "951 cm^3" in warning


def test_a_stated_volume_within_the_interval_is_not() -> None:
    assert _volume_warnings(Rig(vessel_volume=805e-6), estimate(808e-6, 801e-6, 816e-6)) == []
    assert _volume_warnings(Rig(), estimate(808e-6, 801e-6, 816e-6)) == []
    assert _volume_warnings(Rig(vessel_volume=951e-6), []) == []


# --- ``[model.parameters]``: what is known beforehand reaches the fit, and what cannot be meant is told with its key


def known(tmp_path: Path, entries: str) -> dict[str, ParameterPrior]:
    (tmp_path / "raw").mkdir(exist_ok=True)
    path = tmp_path / "pipeline.toml"
    path.write_text(BASE.replace("[checks]", f"[model.parameters]\n{entries}\n[checks]"))
    return parameter_priors(load(path), catalogue())


def test_quantities_are_read_in_the_parameters_own_unit(tmp_path: Path) -> None:
    found = known(
        tmp_path,
        """
        "friction.viscous" = { fixed = "45 N s/m" }
        "rig.moving_mass" = { start = "2.2 kg", min = "2000 g", max = 3, sigma = "0.1 kg" }
        "rig.piston_area_1" = { sigma = "0.1 cm^2" }
        "pressure-friction.gain" = { max = "2 1/MPa" }
        "valve.effective_area(+1 V)" = { max = "1 mm^2" }
        """,
    )
    assert found["friction.viscous"] == ParameterPrior("N s/m", fixed=45.0)
    assert found["rig.moving_mass"] == ParameterPrior("kg", None, 2.2, 2.0, 3.0, 0.1)
    assert (found["rig.piston_area_1"].start, found["rig.piston_area_1"].sigma) == pytest.approx((9.5e-4, 1e-5))
    assert found["valve.effective_area(+1 V)"].upper == pytest.approx(1e-6)


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ('"friction.viscos" = { fixed = 1 }', 'did you mean "friction.viscous"?'),
        ('"friction.viscous" = { fixed = "45 N" }', '"friction.viscous".fixed: "45 N" has not the dimension'),
        ('"friction.viscous" = {}', "nothing is said of it"),
        ('"friction.viscous" = { fixed = 1, max = 2 }', "what is fixed has no max"),
        ('"friction.viscous" = { min = 2, max = 1 }', "is not below max"),
        ('"friction.viscous" = { start = 3, max = 1 }', "lies outside"),
        ('"friction.viscous" = { sigma = 1 }', "sigma without start"),
        ('"rig.piston_area_1" = { sigma = 0 }', "above 0"),
    ],
)
def test_what_cannot_be_meant_is_told_with_its_key(tmp_path: Path, entry: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        known(tmp_path, entry)
    assert says in str(error.value)
    assert "model.parameters" in str(error.value)


def test_the_file_without_entries_knows_nothing(tmp_path: Path) -> None:
    assert parameter_priors(load(write(tmp_path)), catalogue()) == {}


def test_every_key_that_is_missing_is_told_with_an_example(tmp_path: Path) -> None:
    area = RequiredInput("rig.cylinder", "piston_area_1", "the area on which p1 acts (axis_1)", '"8.04 cm^2"')
    pressure = RequiredInput("[recordings]", "p2", "the pressure of chamber 2 (axis_1)", '"1.013 bar"')
    with pytest.raises(InputError) as error:
        require_stated([area, pressure], tmp_path / "p.toml")
    assert "key rig.cylinder.piston_area_1: missing" in str(error.value)
    assert 'add piston_area_1 = "8.04 cm^2" below [rig.cylinder]' in str(error.value)
    assert "key recordings.p2: missing" in str(error.value)
    require_stated([], tmp_path / "p.toml")


@pytest.mark.parametrize(
    ("entry", "supply"), [('start = "8 bar"', 8e5), ('fixed = "7 bar"', 7e5), ('min = "1 bar"', None)]
)
def test_a_pump_states_its_stall_pressure_as_a_start_in_place_of_a_regulated_supply(
    tmp_path: Path, entry: str, supply: float | None
) -> None:
    (tmp_path / "raw").mkdir()
    path = tmp_path / "pipeline.toml"
    path.write_text(BASE.replace("[checks]", f'[model.parameters]\n"rig.supply_pressure" = {{ {entry} }}\n[checks]'))
    assert with_started_supply(Rig(), load(path)).supply_pressure == (supply and pytest.approx(supply))
    assert with_started_supply(Rig(supply_pressure=6e5), load(path)).supply_pressure == 6e5


# --- A steady flow bench from its CSV to the report: no clock, nothing filtered, C, b, m, maps, verdicts, refusals


SEVERAL = {1.0: 5e-9, 2.0: 1e-8, 4.0: 2e-8}


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """The folder of the artifacts, and the answers of all stages that apply."""
    folder = tmp_path_factory.mktemp("bench")
    write_csv(folder / "rows.csv", bench_rows(3, SEVERAL))
    path = folder / "pipeline.toml"
    path.write_text(PIPELINE)
    out = folder / "out"
    answers = run_stages(path, out)
    for name, stage in (("diagnose", diagnose), ("report", report)):
        (out / name).mkdir()
        answers[name] = stage.run(Context(path, load(path), out / name, out, answers=answers))
    return out, answers


@pytest.mark.parametrize("stage", ["identify", "compare", "diagnose"])
def test_answers_are_declared_json_that_people_can_read(bench, stage):
    answer = bench[1][stage]
    json.dumps(answer, allow_nan=False)
    known_as_declared(stage, answer)
    assert messages.render(stage, answer, "pipeline.toml", verbose=True)


def test_rows_are_kept_as_they_are(bench):
    table = read_table(bench[0] / "ingest" / "signals.parquet")
    assert table["time"].tolist() == list(range(48))
    assert np.allclose(table["flow"], bench_rows(3, SEVERAL)["flow"], rtol=1e-3, atol=1e-8)
    (row,) = bench[1]["ingest"]["recordings"]
    assert row["noise"] == {}
    assert bench[1]["ingest"]["repairs"] == []


def test_parameters_are_named_by_command(bench):
    found = bench[1]["identify"]["model"]["parameters"]
    for u, c in SEVERAL.items():
        low, high = found[f"valve.sonic_conductance({u:+g} V)"]["ci95"]
        assert low <= c <= high
    names = read_table(bench[0] / "identify" / "parameters.parquet")["name"]
    assert {"valve.critical_ratio(+1 V)", "valve.subsonic_index(+4 V)"} <= set(names)
    assert bench[1]["identify"]["flow"]["command_sets_area"] is True


def test_the_map_of_the_vessel_is_the_flow_over_its_volume(bench):
    flow, gradient = (read_table(bench[0] / "identify" / f"{n}_map.parquet") for n in ("flow", "valve"))
    level = flow["p_supply"] == np.max(flow["p_supply"])
    u, p = 4.0, np.unique(gradient["p"])[10]
    dp = gradient["p_gradient"][(gradient["u"] == u) & (gradient["p"] == p)][0]
    q = np.interp(p, flow["p"][level & (flow["u"] == u)], flow["flow"][level & (flow["u"] == u)])
    assert dp == pytest.approx(1.4 * 287.0 * 293.15 / 1e-3 * q, rel=2e-3)
    inverse = read_table(bench[0] / "identify" / "valve_inverse.parquet")
    assert set(inverse) == {"p_gradient", "p", "u", "reachable"}


def test_compare_stands_at_the_noise(bench):
    (channel,) = bench[1]["compare"]["channels"]
    assert channel["channel"] == "flow"
    assert channel["unit"] == "kg/s"
    assert 0.4 < channel["ratio_to_noise"] < 1.5


def test_the_critical_ratio_is_the_effect_that_is_missing(bench):
    answer = bench[1]["diagnose"]
    assert answer["verdict"] == "missing-effect"
    assert answer["missing"] == ["critical-ratio"]
    (named,) = [c for c in answer["candidates"] if c["supported"]]
    low, high = named["parameters"]["critical_ratio"]["ci95"]
    assert low <= 0.3 <= high
    assert {c["reason"] for c in answer["candidates"] if c["effect"] == "valve-lag"} == {"cannot-show"}


def test_the_report_has_the_chapter(bench):
    page = (bench[0] / "report" / "report.html").read_text(encoding="utf-8")
    assert "Steady flow bench" in page
    assert "conductance in l/(s bar)" in page


def test_stages_over_time_do_not_apply(bench):
    out, answers = bench
    path = out.parent / "pipeline.toml"
    with pytest.raises(NotApplicable):
        simulate.run(Context(path, load(path), out / "simulate", out, answers=answers))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ('to = "3 s"', "rows without a clock: to"),
        ('[recordings.signals]\ntime = { column = "t", unit = "s" }', "rows without a clock: signals.time"),
        ('take = ["time", "flow"]', "rows without a clock: take = time"),
        ('valve = "shut"', "rows without a clock: valve"),
    ],
)
def test_keys_of_a_clock_are_refused(tmp_path, keys, said):
    path = tmp_path / "pipeline.toml"
    path.write_text(PIPELINE + keys + "\n")
    with pytest.raises(InputError, match="line") as caught:
        load(path)
    assert said in str(caught.value)


def test_without_an_upstream_pressure_the_key_is_named(tmp_path):
    write_csv(tmp_path / "rows.csv", bench_rows(3, SEVERAL))
    path = tmp_path / "pipeline.toml"
    path.write_text("\n".join(line for line in PIPELINE.splitlines() if not line.startswith("p_supply")))
    answer = check.check_pipeline(path)
    assert [need.key for need in answer.missing] == ["supply_pressure"]


def test_a_plain_volume_flow_is_read_at_the_reference_atmosphere_and_said(tmp_path):
    write_csv(tmp_path / "rows.csv", bench_rows(3, SEVERAL))
    path = tmp_path / "pipeline.toml"
    path.write_text(PIPELINE.replace('unit = "l/min ANR"', 'unit = "l/min"'))
    answers = run_stages(path, tmp_path / "out")
    found = answers["identify"]["model"]["parameters"]["valve.sonic_conductance(+1 V)"]["ci95"]
    assert found[0] <= 5e-9 <= found[1]
    assert any("ANR" in one["what"] for one in answers["identify"]["assumed"])


def test_a_closed_valve_that_leaks_is_named(tmp_path):
    write_csv(tmp_path / "rows.csv", bench_rows(3, {0.0: 2e-10, **SEVERAL}))
    path, out = tmp_path / "pipeline.toml", tmp_path / "out"
    path.write_text(PIPELINE)
    answers = run_stages(path, out)
    (out / "diagnose").mkdir()
    answer = diagnose.run(Context(path, load(path), out / "diagnose", out, answers=answers))
    assert set(answer["missing"]) == {"critical-ratio", "valve-leak"}
    area = next(c for c in answer["candidates"] if c["effect"] == "valve-leak")["parameters"]["area"]
    assert area["value"] == pytest.approx(2e-10 * 1.185 / 0.00233, rel=0.1)  # kg/(s Pa) over choked flow per Pa and m^2


def test_init_recognises_the_rows(tmp_path):
    write_csv(tmp_path / "rows.csv", bench_rows(3, SEVERAL))
    found = create(tmp_path / "new", [tmp_path / "rows.csv"])
    assert found.recordings[0].experiment == "flow"
    taken = {row.signal for row in found.columns}
    assert {"u", "p_supply", "p1", "flow"} <= taken
    assert found.fill_in == []
