"""The first stages of a pipeline, one after the other."""

from pathlib import Path
from typing import Any

from pneucli.config import load
from pneucli.pipeline.graph import STAGES, Context
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


def known_as_declared(stage: str, answer: dict[str, Any]) -> None:
    """Hold an answer's keys, and where they are declared the keys below, against what checks may look into."""
    begins = [tuple(begin.split(".")) for begin in STAGES[stage].answer_paths]
    assert answer.keys() - {"schema", "pipeline"} <= {begin[0] for begin in begins}
    for first, second in (begin for begin in begins if len(begin) == 2 and answer.get(begin[0]) is not None):
        assert second in answer[first]
        assert answer[first].keys() <= {begin[1] for begin in begins if begin[0] == first}
