"""One run: a pipeline file and the folder of its artifacts, or only such a folder."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneucli.errors import InputError
from pneucli.imports import paused_collection
from pneucli.messages import answer_of, compare, diagnose, ingest
from pneucli.messages.compare import evaluation_error
from pneucli.messages.formatting import format_noise_ratio, join_names
from pneucli.notebook.run_data import RunData
from pneucli.pipeline.graph import STAGES
from pneucli.pipeline.manifest import MANIFEST_FILE, read_answers
from pneucli.pipeline.runner import Pipeline, open_pipeline

if TYPE_CHECKING:
    from pneucli.notebook.live_page import LivePage
    from pneucli.notebook.plots import Plots


Rows = Sequence[tuple[str, str]]
MAX_NAMES = 6  # recordings in the overview


def open_run(path: str | Path, out: str | Path | None = None, *, quiet: bool = False) -> Run:
    """Return the run of a pipeline file, or of a folder of artifacts.

    A pipeline file (TOML) is brought up to date before each answer, as on the command line. A folder of artifacts
    (``"artifacts/axis-7"``) is read unchanged: it may come from another machine, without pipeline file and raw files.

    Args:
        path: The pipeline file or the folder.
        out: The folder of the artifacts of a pipeline file; by default ``artifacts/NAME`` next to the file.
        quiet: Print no progress on standard error.

    Raises:
        InputError: There is neither file nor folder at ``path``.

    """
    path = Path(path)
    if path.is_dir():
        if out is not None:
            raise InputError(
                str(path), "a folder of artifacts has no other folder", mend="leave out, or name the file", code="E001"
            )
        if not any((path / stage / MANIFEST_FILE).is_file() for stage in STAGES):
            wanted = "a folder that pneucli wrote, such as artifacts/axis-7, or a pipeline file"
            raise InputError(str(path), "no stage's artifacts are here", wanted, code="E007")
        return Run(path.absolute(), None, quiet)
    pipeline = open_pipeline_of(path, None if out is None else Path(out))
    return Run(pipeline.artifacts, pipeline, quiet)


def open_pipeline_of(path: Path, out: Path | None = None) -> Pipeline:
    """Open a pipeline file; validate it only when it has changed (the units take half a second to import)."""
    from pneucli.pipeline.workload import workload  # noqa: PLC0415 - a folder of artifacts needs none

    def load(path: Path) -> Any:
        with paused_collection():
            from pneucli.stages.pipeline_file import load_pipeline_file  # noqa: PLC0415

        return load_pipeline_file(path)

    return replace(open_pipeline(path, load, out), workload=workload)


@dataclass(frozen=True, repr=False)
class Run(RunData):
    """Artifacts as DataFrames, answers as dictionaries, figures, and the identified model."""

    def __repr__(self) -> str:

        return as_text(f"Run {self.artifacts.name}", run_overview(self.artifacts))

    def _repr_html_(self) -> str:

        return as_html(f"Run {self.artifacts.name}", run_overview(self.artifacts))

    @property
    def plot(self) -> Plots:
        """Figures of this run (matplotlib)."""
        from pneucli.notebook.plots import Plots  # noqa: PLC0415 - matplotlib takes a moment

        return Plots(self)

    def workbench(self) -> LivePage:
        """Serve the live page of this run, shown in a frame of the notebook; ``close()`` ends it."""
        from pneucli.notebook.live_page import open_live_page  # noqa: PLC0415 - the command line has its own server

        return open_live_page(self.pipeline, open_pipeline_of)


def run_overview(artifacts: Path) -> list[tuple[str, str]]:
    """Return label and text of each line: model, error, verdict, recordings, finished stages, folder."""
    answers = read_answers(artifacts, STAGES)
    rows = [("folder", str(artifacts))]
    if "compare" in answers:
        compared = answer_of(compare.Answer, answers)
        use, error = evaluation_error(compared.error)
        rows.append(("model", " + ".join(["base", *compared.model.effects])))
        rows.append(("error", f"{format_noise_ratio(error)} × noise on {use} recordings"))
    if "diagnose" in answers:
        rows.append(("verdict", answer_of(diagnose.Answer, answers).sentence))
    if "ingest" in answers:
        names = [one.name for one in answer_of(ingest.Answer, answers).recordings]
        more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
        rows.append(("recordings", f"{len(names)}: {', '.join(names[:MAX_NAMES])}{more}"))
    rows.append(("stages", join_names(list(answers)) or "none has run"))
    return rows


def as_text(title: str, rows: Rows) -> str:
    """Return an overview as text."""
    width = max(len(label) for label, _ in rows)
    return "\n".join([title, *(f"  {label:<{width}}  {text}" for label, text in rows)])


def as_html(title: str, rows: Rows) -> str:
    """Return an overview as a table of HTML; names are escaped."""
    cell = '<td style="text-align:left">{}</td>'
    lines = (f"<tr>{cell.format(html.escape(a))}{cell.format(html.escape(b))}</tr>" for a, b in rows)
    return f"<strong>{html.escape(title)}</strong><table>{''.join(lines)}</table>"
