"""The stages, what each reads, the order in which they run, and the context of one run of a stage."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from graphlib import TopologicalSorter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneucli.errors import InputError

if TYPE_CHECKING:
    from pneucli.config import PipelineConfig


class Progress:
    """What stages report their progress to; this one shows nothing."""

    def begin(self, work: str, seconds: float | None) -> None:
        """Note that a work begins, and about how long it will take; None where nothing tells."""

    def __call__(self, message: str, share: float | None = None) -> None:
        """Note what is being done.

        Args:
            message: What is being done.
            share: The part of the work that is done (0 to 1), where it is counted in parts that take equally long.

        """


NO_PROGRESS = Progress()


@dataclass(frozen=True)
class Workload:
    """What a stage has before it.

    Attributes:
        text: The counts that decide how long it takes: ``"6 recordings, 48,000 samples"``.
        units: A number to which its time is about proportional, above 0.

    """

    text: str
    units: float


@dataclass(frozen=True)
class Context:
    """One run of one stage.

    Attributes:
        path: The pipeline file.
        config: Its validated content.
        artifacts: The folder of the earlier stages' folders (``artifacts / "ingest" / "signals.parquet"``).
        out: An empty folder for the stage's files; it replaces the former folder when the stage has returned.
        answers: The answers of the earlier stages; a stage that does not apply to this rig has none.
        progress: What reports what is being done.
        options: The stage's command line options (``{"exclude": [...]}``).
        former: The stage's folder of its last run, which ``out`` will replace; it need not exist.

    """

    path: Path
    config: PipelineConfig
    out: Path
    artifacts: Path
    progress: Progress = NO_PROGRESS
    answers: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    former: Path | None = None


class NotApplicable(InputError):  # noqa: N818 - it describes the stage, not a failure
    """A stage does not apply to this pipeline, such as the design of a controller to a rig without cylinder.

    If the user asked for the stage by name it is an input error (exit 2); else the runner records it and goes on.
    """


@dataclass(frozen=True)
class Stage:
    """One stage, a row of ``stages.toml``: ``module.run(context) -> answer``.

    Attributes:
        name: The name of the stage and of its module.
        title: One line for ``--help``.
        parents: The stages that must be up to date first.
        optional: Further ones, as far as they apply to the rig.
        tables: The tables of the pipeline file that the stage reads itself, in addition to those of its parents.
        files: The (table, key) that names input files or globs.
        answer_paths: Beginnings of the paths of ``[checks]``: keys of the answer, dotted as far as they are constant.
        alone: An option, and the values of it with which the stage reads no optional stage.
        package: The package of the module.

    """

    name: str
    title: str
    parents: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()
    files: tuple[str, str] | None = None
    answer_paths: tuple[str, ...] = ()
    alone: tuple[str, frozenset[str]] | None = None
    package: str = "pneucli.stages"

    @property
    def module(self) -> str:
        """Dotted path of the module."""
        return f"{self.package}.{self.name}"

    def with_options(self, options: Mapping[str, Any]) -> Stage:
        """Return the stage as it reads with these command line options."""
        if self.alone is None or not options.get(self.alone[0]) or set(options[self.alone[0]]) - self.alone[1]:
            return self
        return replace(self, optional=())


def _stage(name: str, row: Mapping[str, Any]) -> Stage:
    """Return the stage of a row of ``stages.toml``."""
    paths = [f"{begin}.{key}".lstrip(".") for begin, keys in row.get("answers", {}).items() for key in keys]
    about: dict[str, Any] = {key: tuple(row[key]) for key in ("parents", "optional", "tables") if key in row}
    files = tuple(row["files"]) if "files" in row else None
    alone = (row["alone"][0], frozenset(row["alone"][1])) if "alone" in row else None
    return Stage(name, row["title"], **about, files=files, answer_paths=tuple(paths), alone=alone)


_TABLE = Path(__file__).with_name("stages.toml")
STAGES: dict[str, Stage] = {
    name: _stage(name, row) for name, row in tomllib.loads(_TABLE.read_text(encoding="utf-8")).items()
}
# a plan from the rig's description alone: no stage runs before it
FIRST_PLAN_STAGES: dict[str, Stage] = {
    "plan": replace(STAGES["plan"], parents=(), tables=("pipeline", "rig", "plan", "model"))
}


def upstream(targets: Iterable[str], stages: Mapping[str, Stage] = STAGES) -> list[str]:
    """Return ``targets`` and all stages that they need, parents before children."""
    needed: dict[str, tuple[str, ...]] = {}
    waiting = list(targets)
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed[name] = (*stages[name].parents, *stages[name].optional)
            waiting.extend(needed[name])
    position = {name: i for i, name in enumerate(stages)}
    sorter = TopologicalSorter({name: needed[name] for name in sorted(needed, key=position.__getitem__)})
    return list(sorter.static_order())
