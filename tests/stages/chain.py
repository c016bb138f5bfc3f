"""The first stages of a pipeline, one after the other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pneucli.config import load
from pneucli.pipeline.context import Context
from pneucli.stages import compare, identify, ingest

FIRST = (("ingest", ingest), ("identify", identify), ("compare", compare))


def run_stages(path: Path, out: Path) -> dict[str, Any]:
    """Run ingest, identify and compare into ``out`` and return their answers."""
    config, answers = load(path), {}
    for name, stage in FIRST:
        folder = out / name
        folder.mkdir(parents=True, exist_ok=True)
        answers[name] = stage.run(Context(path, config, folder, out, answers=answers))
    return answers
