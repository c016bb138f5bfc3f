"""A contradiction leaves out the recording or the signal that it concerns, and says so; a doubt leaves out nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pneucli.config import load
from pneucli.pipeline.context import Context
from pneucli.plausibility.rig_check import contradictions
from pneucli.stages import ingest
from pneucli.stages.pipeline_data import PipelineData
from tests.plausibility.faulty_data_sets import MM_AS_M, P2, A, Mistake, Rig, X, held, stated

BOTH_FITTED = stated('(name = "stickslip_2"(?:.*\n)*?use = )"test"', r'\1"train"')


def pipeline_of(mistake: Mistake, folder: Path, **options: Any) -> PipelineData:
    """Return the data of a rig on which stickslip_2 and driven_1 are fitted and driven_2 is held out."""
    path = mistake(BOTH_FITTED(Rig.of("friction", noise=True))).write(folder)
    config, out = load(path), folder / "out"
    answer = ingest.run(Context(path, config, out / "ingest", out))
    return PipelineData(Context(path, config, out / "none", out, answers={"ingest": answer}, options=options))


def left_out(pipeline: PipelineData) -> list[tuple[str | None, str | None]]:
    return [(part.recording, part.signal) for part in pipeline.contradicted]


def test_one_false_recording_is_left_out_and_the_others_are_used(tmp_path: Path) -> None:
    pipeline = pipeline_of(held(P2, 2.0, "driven_1"), tmp_path)
    assert [one.name for one in pipeline.recordings] == ["stickslip_2", "driven_2"]
    assert left_out(pipeline) == [("driven_1", None)]
    assert pipeline.impossible == []


def test_of_a_dead_derivative_the_signal_alone_is_left_out(tmp_path: Path) -> None:
    pipeline = pipeline_of(held(A, 0.0, "driven_1"), tmp_path)
    assert ["a" in one for one in pipeline.recordings] == [True, False, True]
    assert left_out(pipeline) == [("driven_1", "a")]
    assert pipeline.impossible == []


def test_where_nothing_else_is_left_to_fit_all_are_used_and_called_impossible(tmp_path: Path) -> None:
    pipeline = pipeline_of(MM_AS_M, tmp_path)
    assert len(pipeline.recordings) == 3
    assert left_out(pipeline) == []
    assert {one.recording for one in pipeline.impossible} == {"stickslip_2", "driven_1", "driven_2"}


@pytest.mark.parametrize("options", [{}, {"force": True}])
def test_force_and_doubts_leave_nothing_out(options: dict[str, Any], tmp_path: Path) -> None:
    mistake = held(P2, 2.0, "driven_1") if options else held(X, 100.0, "driven_2")
    pipeline = pipeline_of(mistake, tmp_path, **options)
    found = pipeline.ingested.plausibility
    assert found
    assert bool(contradictions(found)) == bool(options)
    assert len(pipeline.recordings) == 3
    assert (pipeline.contradicted, pipeline.impossible) == ([], [])


def test_errors_of_other_recordings_are_errors_of_other_data(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    mistake = held(P2, 2.0, "driven_1")
    fewer = pipeline_of(mistake, tmp_path / "a").data_digest
    assert fewer != pipeline_of(mistake, tmp_path / "b", force=True).data_digest
