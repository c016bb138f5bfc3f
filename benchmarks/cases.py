"""Cases, ready to be fitted: of an exam that ``pneucli exam`` wrote, or of a rig by other hands."""

from __future__ import annotations

from pathlib import Path

from pneucli.config import load
from pneucli.pipeline.context import Context
from pneucli.stages import ingest
from pneucli.stages.pipeline_data import PipelineData


def study_of(case: Path, folder: Path, most: int | None = None) -> PipelineData:
    """Return a case, ingested into an empty folder, as the stages after ``ingest`` see it."""
    path = case / "pipeline.toml"
    (folder / "ingest").mkdir()
    ingest.run(Context(path, load(path), folder / "ingest", folder))
    return PipelineData(Context(path, load(path), folder / "none", folder), max_samples=most)
