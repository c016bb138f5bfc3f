"""The data of one run: its tables, its answers, its valve maps and its model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pneucli.errors import InputError
from pneucli.notebook.progress import ignore_message, print_message, progress
from pneucli.pipeline.manifest import read_manifest
from pneucli.pipeline.runner import Pipeline

if TYPE_CHECKING:
    import pandas as pd

    from pneucli.notebook.data_frames import ValveMap
    from pneucli.simulate.model import Model
    from pneucli.stages.pipeline_data import PipelineData


@dataclass(frozen=True)
class RunData:
    """Artifacts as DataFrames, answers as dictionaries, and the identified model.

    ``artifacts`` is the folder; ``pipeline`` the opened pipeline file, None where only the folder is available.
    """

    artifacts: Path
    pipeline: Pipeline | None = None
    quiet: bool = False

    def bring_up(self, *stages: str, options: Mapping[str, Mapping[str, Any]] | None = None) -> None:
        """Bring stages (``"compare"``, ``"diagnose"``) up to date; without a pipeline file do nothing.

        ``options`` are command line options by stage. Raises InputError as the stages do.
        """
        if self.pipeline is not None:
            notify: Callable[[str], None] = ignore_message if self.quiet else print_message
            with progress(self.quiet) as show_progress:
                self.pipeline.update(stages, options, show_progress, notify)

    def answer(self, stage: str) -> dict[str, Any]:
        """Return what ``pneucli STAGE --json`` prints."""
        self.bring_up(stage)
        manifest = read_manifest(self.artifacts / stage)
        if manifest is None or manifest.answer is None:
            mend = f"run pneucli {stage} on its pipeline file"
            raise InputError(str(self.artifacts / stage), "this stage has not run", "", mend, code="E007")
        return dict(manifest.answer)

    def table(self, name: str) -> pd.DataFrame:
        """Return an artifact by its path without ending, such as ``"identify/friction_curves"``."""
        from pneucli.notebook.data_frames import read_frame  # noqa: PLC0415 - pandas takes a moment

        self.bring_up(name.partition("/")[0])
        return read_frame(self.artifacts / f"{name}.parquet")

    @property
    def signals(self) -> pd.DataFrame:
        """Every recording in SI: recording, time, then a column for each signal."""
        return self.table("ingest/signals")

    @property
    def residuals(self) -> pd.DataFrame:
        """Measured, model and residual: recording, use, time, channel, unit, measured, model, residual, segment."""
        return self.table("compare/residuals")

    @property
    def ladder(self) -> pd.DataFrame:
        """The error over noise after each added effect: add, error_train, error_test."""
        return self.table("diagnose/ladder")

    @property
    def candidates(self) -> pd.DataFrame:
        """Every tested effect, a row for each of its parameters: effect, error_before, error_after, ..."""
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
        """The valve map of chamber 1."""
        return self._valve_map(1)

    @property
    def valve_2(self) -> ValveMap:
        """The valve map of chamber 2; raises InputError where the valve drives only chamber 1."""
        return self._valve_map(2)

    def _valve_map(self, chamber: Literal[1, 2]) -> ValveMap:
        from pneucli.notebook.data_frames import ValveMap, select_rows  # noqa: PLC0415 - pandas takes a moment

        maps = [self.table(f"identify/valve_{name}") for name in ("map", "inverse")]
        chambers = set(maps[0]["chamber"]) if "chamber" in maps[0] else {1}
        if chamber not in chambers:
            raise InputError(
                str(self.artifacts / "identify"),
                f"there is no map of chamber {chamber}",
                f"one of {sorted(chambers)}",
                code="E091",
            )
        return ValveMap(*(select_rows(one, {"chamber": chamber} if "chamber" in one else {}) for one in maps))

    @cached_property
    def model(self) -> Model:
        """The identified model, as the simulator takes it."""
        return self.pipeline_data().identified_model

    def pipeline_data(self) -> PipelineData:
        """Return the rig, the recordings and the effects as the stages see them."""
        from pneucli.notebook.model import load_run_data  # noqa: PLC0415 - it imports the kernel

        answers = {stage: self.answer(stage) for stage in ("ingest", "identify")}
        return load_run_data(self.artifacts, self.pipeline, answers)
