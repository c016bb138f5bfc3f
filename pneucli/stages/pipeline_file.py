"""The pipeline file, checked as a whole: by its models, and by the stages that read tables of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pneucli import config
from pneucli.config import PipelineConfig
from pneucli.errors import InputError, did_you_mean
from pneucli.pipeline.checks import require_valid_path
from pneucli.pipeline.graph import STAGES

SCENARIO_KINDS = ("open-loop", "closed-loop", "monte-carlo")


def load_pipeline_file(path: Path) -> PipelineConfig:
    """Return the checked pipeline file; nothing in it that is misspelt is found only after minutes.

    Plugins are not loaded. Raises InputError that names file and key of every fault.
    """
    loaded = config.load(path)
    if faults := list(_faults(loaded)):
        raise config.join_faults(path, faults)
    return loaded


def load_rig_description(path: Path) -> PipelineConfig:
    """Return a checked pipeline file that may have no recordings yet; raises InputError as the whole file does."""
    loaded = config.load_description(path)
    if faults := list(_faults(loaded)):
        raise config.join_faults(path, faults)
    return loaded


def _faults(loaded: PipelineConfig) -> Iterator[InputError]:
    where = str(loaded.path)
    if loaded.design:
        from pneucli.design.requirements import read_requirements  # noqa: PLC0415 - it brings the control laws

        yield from _errors_of(read_requirements, loaded.design, f"{where}, key design")
    for number, table in enumerate(loaded.scenarios, 1):
        yield from _errors_of(_read_scenario, table, f"{where}, key scenarios.{number}")
    if loaded.model.parameters and not loaded.model.plugins:  # names of plugins are known once they are loaded
        from pneucli.physics.effects import catalogue_with_sides  # noqa: PLC0415 - it takes a moment, and few files need it
        from pneucli.stages.parameter_priors import parameter_priors  # noqa: PLC0415 - likewise

        yield from _errors_of(parameter_priors, loaded, catalogue_with_sides())
    answer_paths = {stage.name: stage.answer_paths for stage in STAGES.values() if stage.answer_paths}
    for path in loaded.checks:
        yield from _errors_of(require_valid_path, path, answer_paths, f"{where}, [checks]")


def _errors_of(check: Callable[..., Any], *arguments: Any) -> Iterator[InputError]:
    try:
        check(*arguments)
    except InputError as error:
        yield error


def _read_scenario(table: dict[str, Any], where: str) -> None:
    kind = table.get("kind", "open-loop")
    if kind == "open-loop":
        from pneucli.simulate.open_loop import parse_scenario  # noqa: PLC0415 - it brings the kernel

        parse_scenario(table, where)
    elif kind == "closed-loop":
        from pneucli.closed_loop.scenarios import read_scenario as read_closed_loop  # noqa: PLC0415 - likewise

        read_closed_loop({key: value for key, value in table.items() if key != "kind"}, where)
    elif kind == "monte-carlo":
        from pneucli.closed_loop.robustness import read_settings  # noqa: PLC0415 - likewise

        read_settings(table, where)
    else:
        raise InputError(f"{where}.kind", f'"{kind}"', "", did_you_mean(str(kind), SCENARIO_KINDS), code="E023")
