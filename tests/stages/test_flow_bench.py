"""A steady flow bench from its CSV to the report: no clock, nothing filtered, C, b, m, maps, verdicts, refusals."""

import json

import numpy as np
import pytest

from pneucli import messages
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.io.artifacts import read_table
from pneucli.pipeline.graph import Context, NotApplicable
from pneucli.stages import check, diagnose, report, simulate
from pneucli.stages.init import create
from tests.identify_valve.steady_bench import PIPELINE, bench_rows, write_csv
from tests.stages.chain import known_as_declared, run_stages

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
