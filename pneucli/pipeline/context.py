"""What a stage receives when it runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneucli.errors import InputError

if TYPE_CHECKING:
    from pneucli.config import PipelineConfig

Answer = dict[str, Any]
Progress = Callable[[str, float], None]


def no_progress(message: str, fraction: float) -> None:
    """Swallow progress: what a notebook or a test passes."""


@dataclass(frozen=True)
class Context:
    """One run of one stage.

    ``path`` is the pipeline file and ``config`` its validated content. The stage writes its files into ``out``, a
    fresh and empty folder that replaces the stage's former one only when the stage has returned. ``artifacts`` holds
    the finished folders of the stages before (``artifacts / "ingest" / "signals.parquet"``) and ``answers`` what they
    returned; a stage that does not apply to this rig has no entry there. ``progress(message, fraction)`` tells people
    how far the work is (0 to 1). ``options`` are the stage's own command line options (``{"exclude": [...]}``).
    ``former`` is the stage's folder as its last run left it, which ``out`` will replace; it need not be there.
    """

    path: Path
    config: PipelineConfig
    out: Path
    artifacts: Path
    progress: Progress = no_progress
    answers: Mapping[str, Answer] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    former: Path | None = None


class NotApplicable(InputError):  # noqa: N818 - it says what the stage is, not that something broke
    """Raised by a stage that this pipeline has no use for, such as a controller's design for a rig without cylinder.

    Asked for by name it is the user's error (exit 2); on the way to another stage it is noted and passed over.
    """
