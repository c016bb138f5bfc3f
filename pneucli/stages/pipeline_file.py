"""The pipeline file, checked as a whole: by its models, and by the stages that read tables of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pneucli import config
from pneucli.config import PipelineConfig
from pneucli.design.requirements import requirements_from
from pneucli.errors import InputError, did_you_mean
from pneucli.pipeline.checks import require_known
from pneucli.pipeline.graph import STAGES

KINDS = ("open-loop", "closed-loop", "monte-carlo")


def load(path: Path) -> PipelineConfig:
    """Return the checked pipeline file; nothing in it that is misspelt is found only after minutes.

    Plugins are not loaded. Raises InputError that names file and key of every fault.
    """
    loaded = config.load(path)
    if faults := list(_faults(loaded)):
        raise config.join_faults(path, faults)
    return loaded


def _faults(loaded: PipelineConfig) -> Iterator[InputError]:
    where = str(loaded.path)
    yield from _raised(requirements_from, loaded.design, f"{where}, key design")
    for number, table in enumerate(loaded.scenarios, 1):
        yield from _raised(_read_scenario, table, f"{where}, key scenarios.{number}")
    if loaded.model.parameters and not loaded.model.plugins:  # names of plugins are known once they are loaded
        from pneucli.physics.effects import catalogue  # noqa: PLC0415 - it takes a moment, and few files need it
        from pneucli.stages.parameter_priors import known_of  # noqa: PLC0415 - likewise

        yield from _raised(known_of, loaded, catalogue())
    known = {stage.name: stage.answer for stage in STAGES.values() if stage.answer}
    for path in loaded.checks:
        yield from _raised(require_known, path, known, f"{where}, [checks]")


def _raised(check: Callable[..., Any], *arguments: Any) -> Iterator[InputError]:
    try:
        check(*arguments)
    except InputError as error:
        yield error


def _read_scenario(table: dict[str, Any], where: str) -> None:
    kind = table.get("kind", "open-loop")
    if kind == "open-loop":
        from pneucli.simulate.open_loop import read_table  # noqa: PLC0415 - it brings the kernel

        read_table(table, where)
    elif kind == "closed-loop":
        from pneucli.closed_loop.scenarios import read_table as read_closed_loop  # noqa: PLC0415 - likewise

        read_closed_loop({key: value for key, value in table.items() if key != "kind"}, where)
    elif kind == "monte-carlo":
        from pneucli.closed_loop.robustness import settings_from  # noqa: PLC0415 - likewise

        settings_from(table, where)
    else:
        raise InputError(f"{where}.kind", f'"{kind}"', "", did_you_mean(str(kind), KINDS))
