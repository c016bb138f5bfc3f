"""Load a run, its recordings and its model, from the folder of its artifacts."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pneucli.config import validate
from pneucli.io.artifacts import read_metadata
from pneucli.io.recordings import SIGNALS_FILE
from pneucli.pipeline.graph import Context
from pneucli.pipeline.runner import Pipeline
from pneucli.quantities import ROTARY_UNITS, axis_motion
from pneucli.stages.pipeline_data import MODEL_FILE, PipelineData

Answers = Mapping[str, dict[str, Any]]  # of the stages ingest and identify, by stage


def load_run_data(artifacts: Path, pipeline: Pipeline | None, answers: Answers) -> PipelineData:
    """Return rig, recordings and effects, from the pipeline file or, without one, from the metadata of the artifacts.

    Args:
        artifacts: The folder of the run.
        pipeline: The opened pipeline file; None where only the folder is available.
        answers: The answers of ``ingest`` and ``identify``.

    """
    if pipeline is not None:
        config = pipeline.load(pipeline.path)
        return PipelineData(Context(pipeline.path, config, artifacts, artifacts, answers=answers))
    path = artifacts / "identify" / MODEL_FILE
    document = {key: table for key, table in read_metadata(path)["parameters"].items() if table}
    keys = ("name", "file", "experiment", "use", "chamber_2")
    document["recordings"] = [{k: r[k] for k in keys if r[k]} for r in answers["ingest"]["recordings"]]
    if is_rotary(artifacts):
        document["signals"] = {"x": {"column": "x", "unit": ROTARY_UNITS["m"]}}
    config = validate(path, document)
    with axis_motion(rotary=config.rotary):
        return PipelineData(Context(path, config, artifacts, artifacts, answers=answers))


def is_rotary(artifacts: Path) -> bool:
    """Return whether the axis turns, so that its position was recorded as an angle."""
    units = read_metadata(artifacts / "ingest" / SIGNALS_FILE)["units"]
    return bool(units.get("x") == ROTARY_UNITS["m"])
