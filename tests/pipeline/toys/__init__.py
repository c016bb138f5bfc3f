"""Five toy stages: raw -> model -> judge, plan (only with a [plan] table), and page over all of them."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pneucli.pipeline.graph import Context, Stage
from pneucli.pipeline.runner import Pipeline, open_pipeline

PACE = 1.0  # how much of the pretended working time is really spent
PARTS = 5  # files a stage; all of one generation, or the folder is half-written

_ALL = (
    Stage("raw", "", tables=("recordings",), files=("recordings", "file"), package=__name__),
    Stage("model", "", parents=("raw",), tables=("model",), package=__name__),
    Stage("judge", "", parents=("model",), tables=("judge",), package=__name__),
    Stage("plan", "", parents=("model",), tables=("plan",), package=__name__),
    Stage("page", "", parents=("judge",), optional=("plan",), tables=("checks",), package=__name__),
)
STAGES = {stage.name: stage for stage in _ALL}

TEXT = """
[pipeline]
name = "toy"
[[recordings]]
file = "raw/*.csv"
[model]
effects = []
"""


def new(folder: Path, text: str = TEXT) -> Path:
    """Write a toy pipeline of two raw files; return its file."""
    (folder / "raw").mkdir(parents=True)
    for name in ("a", "b"):
        (folder / "raw" / f"{name}.csv").write_text("0")
    file = folder / "toy.toml"
    file.write_text(text)
    return file


def load(path: Path) -> dict[str, str]:
    """Validate nothing; note that it was asked to."""
    with (path.parent / "loaded.log").open("a") as log:
        log.write("loaded\n")
    return {"text": path.read_text()}


def toy(file: Path, program: str = "1") -> Pipeline:
    """Open the toy pipeline as read by a program of this version."""
    pipeline = open_pipeline(file, load, stages=STAGES)
    return Pipeline(pipeline.path, pipeline.tables, pipeline.artifacts, load, STAGES, program)


def work(context: Context, generation: str, seconds: float = 0.0) -> dict[str, Any]:
    """Write ``PARTS`` files of one generation, taking ``seconds``; note the run; return the answer."""
    for part in range(PARTS):
        (context.out / f"part-{part}.txt").write_text(generation * 1000)
        time.sleep(PACE * seconds / PARTS)
        context.progress("writing", (part + 1) / PARTS)
    with (context.path.parent / "runs.log").open("a") as log:
        log.write(f"{context.out.name.split('.')[1]}\n")
    return {"generation": generation}


def runs(file: Path) -> list[str]:
    """Which stages ran, in order, since this was last asked."""
    log = file.parent / "runs.log"
    names = log.read_text().split() if log.exists() else []
    log.unlink(missing_ok=True)
    return names


def is_whole(folder: Path) -> bool:
    """Whether all parts of a stage's folder are there, of one generation, and its manifest is too."""
    texts = {(folder / f"part-{part}.txt").read_text() for part in range(PARTS)}
    return len(texts) == 1 and len(texts.pop()) >= 1000 and (folder / "stage.json").stat().st_size > 0


def generations(answers: Mapping[str, Any]) -> set[str]:
    """The generations in a run's answers."""
    return {done.answer["generation"] for done in answers.values()}
