"""Cases with their truths, ready to be fitted: of an exam that ``pneucli exam`` wrote, or of a rig by other hands."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pneucli.config import load
from pneucli.pipeline.context import Context
from pneucli.stages import ingest
from pneucli.stages.pipeline_data import PipelineData

SEALED = ".sealed"


def truths(exam: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Yield the folder of each case and what is true of it, sealed in an exam and beside the pipeline of a rig."""
    for path in sorted(exam.glob("*/truth.json")):
        yield path.parent, json.loads(path.read_text(encoding="utf-8"))
    for path in sorted((exam / SEALED).glob("case-*.json")):
        yield exam / path.stem, json.loads(path.read_text(encoding="utf-8"))


def study_of(case: Path, folder: Path, most: int | None = None) -> PipelineData:
    """Return a case, ingested into an empty folder, as the stages after ``ingest`` see it."""
    path = case / "pipeline.toml"
    (folder / "ingest").mkdir()
    ingest.run(Context(path, load(path), folder / "ingest", folder))
    return PipelineData(Context(path, load(path), folder / "none", folder), max_samples=most)
