"""The plan after a diagnosis of a friction bench: rivals, their power, and a weight where motion shows nothing."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pneucli import messages
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.pipeline.context import Context
from pneucli.stages import ingest, plan
from tests.stages.chain import known_as_declared

BENCH = Path(__file__).parents[2] / "fixtures" / "friction_null_coulomb" / "pipeline.toml"


def candidate(effect: str, confidence: float, *alike: str, named: bool = False) -> dict[str, Any]:
    return {
        "effect": effect,
        "confidence": confidence,
        "confidence_alone": confidence,
        "indistinguishable_from": list(alike),
        "supported": named,
        "reason": "supported" if named else "not-significant",
        "parameters": {"size": {}},
    }


DIAGNOSES: dict[str, dict[str, Any]] = {
    "nothing": {"missing": [], "candidates": [], "data": "0123456789abcdef"},
    "a mass, or a scale": {
        "missing": ["extra-mass"],
        "candidates": [candidate("extra-mass", 0.6, "pressure-scale", named=True)],
        "data": "0123456789abcdef",
    },
    "a lag": {"missing": [], "candidates": [candidate("pressure-lag", 0.3)], "data": "0123456789abcdef"},
}


@pytest.fixture(scope="module")
def ingested(tmp_path_factory: pytest.TempPathFactory) -> Context:
    out = tmp_path_factory.mktemp("plan")
    (out / "ingest").mkdir()
    context = Context(BENCH, load(BENCH), out / "ingest", out)
    return replace(context, answers={"ingest": ingest.run(context)})


def planned(ingested: Context, out: Path, diagnosis: dict[str, Any], **options: Any) -> dict[str, Any]:
    answers = {**ingested.answers, "diagnose": diagnosis}
    return plan.run(replace(ingested, out=out, answers=answers, options={"minutes": 1.0, **options}))


def test_a_mass_that_no_motion_tells_from_a_scale_of_the_pressures_gets_a_weight(
    ingested: Context, tmp_path: Path
) -> None:
    answer = planned(ingested, tmp_path, DIAGNOSES["a mass, or a scale"])
    json.dumps(answer, allow_nan=False)
    known_as_declared("plan", {key: value for key, value in answer.items() if key not in ("files", "folder")})
    assert [r["name"] for r in answer["rivals"]] == [
        "best model", "pressure-scale in place of extra-mass", "without extra-mass"
    ]  # fmt: skip
    expected = {e["rival"]: e for e in answer["expected"]}
    assert expected["without extra-mass"]["probability_before"] == pytest.approx(0.4)
    assert expected["pressure-scale in place of extra-mass"]["power"] >= 0.8
    assert {r["kind"] for r in answer["recordings"] if r["by_hand"]} == {"known-force"}
    assert {r["use"] for r in answer["recordings"]} == {"train", "test"}
    assert set(answer["recordings"][0]["times_noise"]) == {"pressure-scale", "extra-mass"}
    assert {"commands.csv", "plan.html", "power.parquet", "steps.md"} <= set(answer["files"])
    assert "Hang a weight of 2.00 kg" in messages.render("plan", answer, "bench.toml", verbose=True)


def test_what_motion_shows_needs_no_weight_and_other_data_draw_another_programme(
    ingested: Context, tmp_path: Path
) -> None:
    lag = DIAGNOSES["a lag"]
    one, other = (planned(ingested, tmp_path, lag | {"data": data}, minutes=0.4) for data in ("0" * 16, "f" * 16))
    assert one["manual"] == []
    assert [r["kind"] for r in one["recordings"]] != [r["kind"] for r in other["recordings"]]
    assert [e["effect"] for e in one["expected"]] == ["pressure-lag"]


def test_without_a_question_every_effect_has_its_power(ingested: Context, tmp_path: Path) -> None:
    answer = planned(ingested, tmp_path, DIAGNOSES["nothing"], minutes=0.4)
    found = {e["effect"]: e["power"] for e in answer["expected"]}
    assert found == {p["effect"]: p["power"] for p in answer["power"] if p["typical"]}
    assert found["friction-hysteresis"] > 0.8


def test_an_effect_that_the_bench_cannot_show_is_in_question_without_power(ingested: Context, tmp_path: Path) -> None:
    asked = {"effects": ["valve-lag", "stribeck"], "minutes": 0.4}
    answer = planned(ingested, tmp_path, DIAGNOSES["nothing"], **asked)
    assert [(e["effect"], e["power"] > 0.8) for e in answer["expected"]] == [("valve-lag", False), ("stribeck", True)]


def test_an_unknown_effect_and_limits_without_a_manoeuvre_are_refused(ingested: Context, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="stribeck"):
        planned(ingested, tmp_path, DIAGNOSES["nothing"], effects=["stribek"])
    narrow = load(BENCH).model_copy(update={"plan": load(BENCH).plan.model_copy(update={"max_pressure": 1e4})})
    with pytest.raises(
        InputError, match=r"the nearest is .* pressure of chamber 1"
    ):
        planned(replace(ingested, config=narrow), tmp_path, DIAGNOSES["nothing"])
    with pytest.raises(InputError, match="--minutes"):
        planned(ingested, tmp_path, DIAGNOSES["nothing"], minutes=0.1)
