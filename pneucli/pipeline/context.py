"""The context of one run of a stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
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
