"""One run: a pipeline file and the folder of its artifacts, or such a folder alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pneucli.errors import InputError
from pneucli.notebook.progress import ignore_message, print_message, progress
from pneucli.pipeline import manifest as staleness
from pneucli.pipeline.graph import STAGES
from pneucli.pipeline.runner import Pipeline, open_pipeline

if TYPE_CHECKING:
    import pandas as pd

    from pneucli.notebook.plots import Plots
    from pneucli.notebook.valve_map import ValveMap
    from pneucli.simulate.model import Model


def open_run(path: str | Path, out: str | Path | None = None, *, quiet: bool = False) -> Run:
    """Return the run of a pipeline file, or of a folder of artifacts.

    Of a pipeline file (TOML) whatever is asked for is brought up to date first, as by the command line; ``out`` is the
    artifacts' folder, by default ``artifacts/NAME`` beside the file. A folder (``"artifacts/axis-7"``) is taken as it
    stands: it may have come from another machine, without pipeline file and raw files. ``quiet``: no progress on
    standard error. Raises InputError where there is neither.
    """
    path = Path(path)
    if path.is_dir():
        if out is not None:
            raise InputError(str(path), "a folder of artifacts has no other folder", mend="leave out, or name the file")
        if not any((path / stage / staleness.MANIFEST_FILE).is_file() for stage in STAGES):
            wanted = "a folder that pneucli wrote, such as artifacts/axis-7, or a pipeline file"
            raise InputError(str(path), "no stage's artifacts are here", wanted)
        return Run(path.absolute(), None, quiet)
    pipeline = open_pipeline_of(path, None if out is None else Path(out))
    return Run(pipeline.artifacts, pipeline, quiet)


def open_pipeline_of(path: Path, out: Path | None = None) -> Pipeline:
    """Open a pipeline file; it is validated only when it has changed (units cost half a second to import)."""

    def load(path: Path) -> Any:
        from pneucli.stages.pipeline_file import load_pipeline_file  # noqa: PLC0415

        return load_pipeline_file(path)

    return open_pipeline(path, load, out)


@dataclass(frozen=True)
class Run:
    """Artifacts as DataFrames, answers as dictionaries, and the identified model.

    ``artifacts`` is the folder; ``pipeline`` the opened pipeline file, None where the folder alone is known.
    """

    artifacts: Path
    pipeline: Pipeline | None = None
    quiet: bool = False

    def bring_up(self, *stages: str, options: Mapping[str, Mapping[str, Any]] | None = None) -> None:
        """Bring stages (``"compare"``, ``"diagnose"``) up to date, with all that they need; a folder stays as it is.

        ``options`` are command line options by stage. Raises InputError as the stages do.
        """
        if self.pipeline is not None:
            tell: Callable[[str], None] = ignore_message if self.quiet else print_message
            with progress(self.quiet) as show:
                self.pipeline.update(stages, options, show, tell)

    def answer(self, stage: str) -> dict[str, Any]:
        """Return what ``pneucli STAGE --json`` prints."""
        self.bring_up(stage)
        manifest = staleness.read_manifest(self.artifacts / stage)
        if manifest is None or manifest.answer is None:
            mend = f"run pneucli {stage} on its pipeline file"
            raise InputError(str(self.artifacts / stage), "this stage has left nothing", "", mend)
        return dict(manifest.answer)

    def table(self, name: str) -> pd.DataFrame:
        """Return an artifact by its path without ending, such as ``"identify/friction_curves"``."""
        from pneucli.notebook.data_frames import read_frame  # noqa: PLC0415 - pandas takes a moment

        self.bring_up(name.partition("/")[0])
        return read_frame(self.artifacts / f"{name}.parquet")

    @property
    def signals(self) -> pd.DataFrame:
        """Every recording in SI: recording, time, then a column a signal."""
        return self.table("ingest/signals")

    @property
    def residuals(self) -> pd.DataFrame:
        """Measured, model and residual: recording, use, time, channel, unit, measured, model, residual, segment."""
        return self.table("compare/residuals")

    @property
    def ladder(self) -> pd.DataFrame:
        """The errors (over the noise) as effects are added: add, error_train, error_test."""
        return self.table("diagnose/ladder")

    @property
    def candidates(self) -> pd.DataFrame:
        """Every effect that was tried, a row for each of its parameters: effect, error_before, error_after, ..."""
        return self.table("diagnose/candidates")

    @property
    def parameters(self) -> pd.DataFrame:
        """The model's parameters: name, value, unit, ci_low, ci_high."""
        return self.table("identify/parameters")

    @property
    def correlation(self) -> pd.DataFrame:
        """Correlation of the fitted parameters: a square table by name (1 on the diagonal)."""
        long = self.table("identify/correlation")
        wide = long.pivot_table(index="name", columns="other", values="correlation", sort=False)
        return wide.loc[:, wide.index]

    @property
    def recordings(self) -> list[str]:
        """The names of the recordings, in the pipeline file's order."""
        return list(self.table("ingest/recordings")["name"])

    @property
    def valve(self) -> ValveMap:
        """The valve's map, of the paths of chamber 1 where there are two."""
        return self._valve(1)

    @property
    def valve_2(self) -> ValveMap:
        """The valve's map for chamber 2; raises InputError where the rig drives chamber 1 alone."""
        return self._valve(2)

    def _valve(self, chamber: Literal[1, 2]) -> ValveMap:
        from pneucli.notebook.data_frames import select_rows  # noqa: PLC0415 - pandas takes a moment
        from pneucli.notebook.valve_map import ValveMap  # noqa: PLC0415 - likewise

        maps = [self.table(f"identify/valve_{name}") for name in ("map", "inverse")]
        known = set(maps[0]["chamber"]) if "chamber" in maps[0] else {1}
        if chamber not in known:
            raise InputError(str(self.artifacts / "identify"), f"there is no map of chamber {chamber}", f"{known}")
        return ValveMap(*(select_rows(one, {"chamber": chamber} if "chamber" in one else {}) for one in maps))

    @property
    def plot(self) -> Plots:
        """Figures of this run (matplotlib)."""
        from pneucli.notebook.plots import Plots  # noqa: PLC0415 - matplotlib takes a moment

        return Plots(self)

    @cached_property
    def model(self) -> Model:
        """The identified model, as the simulator takes it."""
        from pneucli.notebook.simulation import load_run_model  # noqa: PLC0415 - it brings the kernel

        return load_run_model(self)
