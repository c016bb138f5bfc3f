"""The counts of a stage's first line, and the units of its estimate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pneucli.config import load
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.physics.effects import catalogue
from pneucli.pipeline.context import Context
from pneucli.pipeline.graph import STAGES
from pneucli.pipeline.manifest import Stamp
from pneucli.pipeline.workload import workload
from tests.stages.conftest import DEMO

RECORDINGS = {"recordings": [{"samples": 30_000}, {"samples": 18_000}]}


@pytest.fixture
def context(tmp_path: Path) -> Context:
    """A stage of the demo after ``ingest``, with one effect in the model."""
    config = load(DEMO)
    config = config.model_copy(update={"model": config.model.model_copy(update={"effects": ["supply-droop"]})})
    return Context(DEMO, config, tmp_path, tmp_path, answers={"ingest": RECORDINGS})


def of(context: Context, samples: int) -> Context:
    """The same with one recording of that many samples."""
    return replace(context, answers={"ingest": {"recordings": [{"samples": samples}]}})


@pytest.mark.parametrize(
    ("stage", "text"),
    [
        ("ingest", "2 files, 3.5 MB"),
        ("identify", "2 recordings, 48,000 samples, 1 effect in the model"),
        ("diagnose", f"{len(catalogue()) - 1} effects on 2 recordings, 48,000 samples"),
        ("simulate", "2 recordings"),
        ("report", "2 recordings"),
        ("plan", f"{len(catalogue()) - 1} effects"),
    ],
)
def test_a_stage_counts_what_decides_how_long_it_takes(context: Context, stage: str, text: str) -> None:
    files = {"a.csv": Stamp(2_000_000, 0, ""), "b.csv": Stamp(1_500_000, 0, "")}
    assert workload(stage, context, files).text == text


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage_has_units_above_0_even_of_an_empty_pipeline(context: Context, stage: str) -> None:
    assert workload(stage, replace(context, answers={"ingest": {"recordings": []}}), {}).units > 0


def test_units_grow_with_samples_and_effects(context: Context) -> None:
    assert workload("compare", of(context, 2_000), {}).units == 2 * workload("compare", of(context, 1_000), {}).units
    fewer = replace(context, options={"exclude": ["stribeck"]})
    assert workload("diagnose", fewer, {}).units < workload("diagnose", context, {}).units
    most = workload("diagnose", of(context, MAX_SAMPLES), {}).units
    assert workload("diagnose", of(context, 9 * MAX_SAMPLES), {}).units == most


@pytest.mark.parametrize(
    ("scenarios", "text"),
    [
        ([], "112 Monte Carlo runs"),
        ([{"kind": "monte-carlo", "runs": 40}, {"kind": "closed-loop"}], "40 Monte Carlo runs"),
        ([{"kind": "monte-carlo", "runs": "many"}], "2 recordings"),  # the stage refuses it
        ([{"kind": "closed-loop"}], "2 recordings"),
    ],
)
def test_a_designed_loop_is_run_as_often_as_the_file_says(
    context: Context, scenarios: list[dict[str, Any]], text: str
) -> None:
    config = context.config.model_copy(update={"scenarios": scenarios})
    designed = replace(context, config=config, answers={"ingest": RECORDINGS, "design": {}})
    assert workload("simulate", designed, {}).text == text
