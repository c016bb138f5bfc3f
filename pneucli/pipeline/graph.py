"""The stages, what each reads, and the order in which they run."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from graphlib import TopologicalSorter
from typing import Any


@dataclass(frozen=True)
class Stage:
    """One stage: ``module.run(context) -> answer``.

    Attributes:
        name: The name of the stage and of its module.
        title: One line for ``--help``.
        parents: The stages that must be up to date first.
        optional: Further ones, as far as they are installed and apply to the rig.
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

    @property
    def built(self) -> bool:
        """Whether the module is installed; it is not imported, because it may be heavy."""
        try:
            return importlib.util.find_spec(self.module) is not None
        except ModuleNotFoundError:
            return False


LACK_OF_FIT_PATHS = (
    *(f"lack_of_fit.{key}" for key in ("present", "p", "undetermined", "use", "error", "limit", "worst", "balance")),
    *("free_run", "beyond_fitted", "error_within_fitted"),
)
VALVE_ANSWER_KEYS = (
    "map",
    "volume",
    "overlap",
    "iso",
    "lack_of_fit",
    "residual",
)  # keys for each chamber

_ALL_STAGES = (
    Stage(
        "ingest",
        "raw files -> checked SI signals",
        tables=("pipeline", "rig", "signals", "recordings"),
        files=("recordings", "file"),
        answer_paths=(
            *("recordings", "looks", "left_out", "repairs", "warnings", "plausibility"),
            *("findings.contradictions", "findings.doubts"),
        ),
    ),
    Stage(
        "identify",
        "valve map and inverse, friction models A-F, model parameters",
        parents=("ingest",),
        tables=("pipeline", "model", "identify", "compare"),
        files=("model", "plugins"),
        answer_paths=(
            *("model.effects", "model.parameters", "assumed", "warnings", "contradicted"),
            *(f"{valve}.{what}" for valve in ("valve", "valve_2") for what in VALVE_ANSWER_KEYS),
            "friction.warnings",
            "friction.domain",
            *("friction.taken_out", "friction.models", "friction.kinetic", "friction.deviations"),
            *("friction.breakaway", "friction.over_pressure", "friction.repeats", "leaks.lost", "leaks.flows"),
            "leaks.areas",
            *("flow.paths", "flow.parameters", "flow.command_sets_area", "flow.findings", "flow.noise"),
            *("uncertainty.coverage_factor", "uncertainty.budgets"),
        ),
    ),
    Stage(
        "compare",
        "model against recordings: how much, and where",
        parents=("identify",),
        tables=("pipeline", "compare"),
        files=("recordings", "controller"),
        answer_paths=(
            *("horizon_s", "model.effects", "model.parameters", "channels", "error.train", "error.test", "where"),
            *(
                *LACK_OF_FIT_PATHS,
                "data",
                "number",
                "when",
                "closed_loop",
                "purpose.adequate",
                "purpose.worst",
                "contradicted",
            ),
        ),
    ),
    Stage(
        "diagnose",
        "which physical effect is missing",
        parents=("ingest",),  # it fits the model itself, without waiting for maps and tables
        tables=("pipeline", "model", "compare"),
        files=("model", "plugins"),
        answer_paths=(
            *("verdict", "missing", "ladder", "candidates", "next_experiment", "sentence", *LACK_OF_FIT_PATHS),
            *("unexplained_share", "explained_share", "relative_error", "purpose.adequate", "purpose.worst"),
            *("detectable", "moved", "unexplained", "discrepancy", "plausibility", "contradicted", "warnings"),
            *("model.effects", "data", "held_out", "excluded", "forced", "impossible", "number", "when", "thinned"),
            *("parameters", "since", "changes", "flow.verdict", "flow.missing", "flow.ladder", "flow.sentence"),
        ),
    ),
    Stage(
        "plan",
        "the next experiment: commands, steps for a person, expected power",
        parents=("diagnose",),
        tables=("pipeline", "plan"),
        answer_paths=(
            *("seconds", "recordings", "manual", "rivals", "expected", "power", "limits"),
            *("refused", "refused_count", "sentence", "warnings", "first"),
        ),
    ),
    Stage(
        "design",
        "sliding sector, sliding mode observers, cascade",
        parents=("identify", "compare"),  # acceptance needs the error of the model
        tables=("pipeline", "design", "scenarios"),
        answer_paths=(
            *("requirements", "corners", "sector", "matching", "surface", "warnings"),
            *("lmi.best", "lmi.types", "lmi.vertex_loops", "controllers"),
            *("not_made", "tolerance_um", "compare", "without_map", "ablation", "variants", "gate"),
            *("margins.worst", "margins.points", "margins.poles", "margins.stable", "margins.stuck"),
            *("margins.left_out", "margins.overlap", "margins.units"),
        ),
    ),
    Stage(
        "simulate",
        "open-loop and closed-loop scenarios",
        parents=("identify",),
        optional=("design",),
        tables=("pipeline", "scenarios"),
        answer_paths=("open_loop", "closed_loop", "pid_alone", "tolerance_um", "exported_c", "robust"),
    ),
    Stage(
        "report",
        "one HTML file with its tables as Parquet, a Markdown summary, JUnit XML",
        parents=("compare",),
        optional=("design", "simulate", "diagnose"),
        tables=("pipeline", "checks"),
    ),
    Stage(
        "export",
        "the designed controller and the maps, for a PLC, a cRIO, MATLAB; the plant for other simulators",
        parents=("identify",),
        optional=("design",),
        tables=("pipeline",),
        alone=("to", frozenset({"fmu"})),  # the plant needs no controller
    ),
)

STAGES: dict[str, Stage] = {stage.name: stage for stage in _ALL_STAGES}
# a plan from the rig's description alone: no stage runs before it
FIRST_PLAN_STAGES: dict[str, Stage] = {
    "plan": replace(STAGES["plan"], parents=(), tables=("pipeline", "rig", "plan", "model"))
}


def parents_of(stage: Stage, stages: Mapping[str, Stage]) -> tuple[str, ...]:
    """Return the names of the stages that ``stage`` reads: its parents, and the installed optional ones."""
    return stage.parents + tuple(name for name in stage.optional if stages[name].built)


def upstream(targets: Iterable[str], stages: Mapping[str, Stage] = STAGES) -> list[str]:
    """Return ``targets`` and all stages that they need, parents before children."""
    needed: dict[str, tuple[str, ...]] = {}
    waiting = list(targets)
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed[name] = parents_of(stages[name], stages)
            waiting.extend(needed[name])
    position = {name: i for i, name in enumerate(stages)}
    sorter = TopologicalSorter({name: needed[name] for name in sorted(needed, key=position.__getitem__)})
    return list(sorter.static_order())
