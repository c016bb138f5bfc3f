"""``[model.parameters]`` and the tolerances of ``[rig]``: priors of identified parameters."""

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pneucli import config
from pneucli.config import ParameterTable, PipelineConfig, join_faults
from pneucli.errors import InputError, UnitError, did_you_mean, require_known
from pneucli.messages.formatting import format_plain
from pneucli.physics.declaration import BASE_PARAMETERS, Effect
from pneucli.pipeline.checks import require_valid_path
from pneucli.pipeline.graph import STAGES
from pneucli.quantities import PISTON_AREA_UNITS, ROTARY_UNITS
from pneucli.recording import ParameterPrior, Rig
from pneucli.units import parse_quantity

SCENARIO_KINDS = ("open-loop", "closed-loop", "monte-carlo")


# the valve's own, as identify names them: "valve.effective_area(+1 V)", "valve_2.overlap_fill"
_VALVE = re.compile(r"valve(?:_2)?\.(effective_area|overlap_fill|overlap_vent|gain)(?:\(.+\))?")
MOVING_MASS_NAMES = ("rig.moving_mass", "rig.moment_of_inertia")  # what is moved, and its name where it turns
_VALVE_UNITS = {"effective_area": "m^2", "overlap_fill": "V", "overlap_vent": "V", "gain": "m^2/V"}


def parameter_priors(config: PipelineConfig, effects: Mapping[str, Effect]) -> dict[str, ParameterPrior]:
    """Return what the file says of parameters by name.

    Raises InputError with every name that is none, every quantity of another kind, and bounds that hold nothing.
    """
    units = {name: p.unit for name, p in BASE_PARAMETERS.items() if not name.startswith("valve.")}
    units |= {f"{e.name}.{p.name}": p.unit for e in effects.values() for p in e.parameters}
    if config.rotary:
        units = {name: ROTARY_UNITS.get(unit, unit) for name, unit in units.items()}
        units |= dict.fromkeys(("rig.piston_area_1", "rig.piston_area_2"), PISTON_AREA_UNITS[1])
        units[MOVING_MASS_NAMES[1]] = units[MOVING_MASS_NAMES[0]]
    priors, faults = dict[str, ParameterPrior](), []
    for name, table in config.model.parameters.items():
        valve = _VALVE.fullmatch(name)
        unit = _VALVE_UNITS[valve[1]] if valve else units.get(name)
        where = f'{config.path}, key model.parameters."{name}"'
        if unit is None:
            faults.append(InputError(where, f'"{name}" is no parameter', "", did_you_mean(name, units), code="E091"))
            continue
        try:
            own = MOVING_MASS_NAMES[0] if name == MOVING_MASS_NAMES[1] else name
            priors[own] = _prior_from_table(table, unit, where, stated=_stated_value(config, own))
        except InputError as error:
            faults.append(error)
    if faults:
        raise join_faults(config.path, faults)
    stated = {
        name: ParameterPrior(units[name], start=_stated_value(config, name), sigma=deviation)
        for name, deviation in config.tolerances.items()
        if name in units and name not in priors
    }
    return priors | stated


def priors_in_model(
    config: PipelineConfig, given: Sequence[Effect], available: Mapping[str, Effect]
) -> dict[str, ParameterPrior]:
    """Return what the file says of the model's parameters; those of an effect that is not in the model wait for it.

    A fixed value that refines an effect counts: the diagnosis fits the effect with it.
    """
    there = {e.name for e in given} | {"friction", "rig", "valve", "valve_2"}
    refining = {f"{e.name}.{p.name}" for e in available.values() for p in e.parameters if p.refines}
    return {
        name: one
        for name, one in parameter_priors(config, available).items()
        if name.partition(".")[0] in there or (name in refining and one.fixed is not None)
    }


def with_started_supply(rig: Rig, config: PipelineConfig) -> Rig:
    """Return the rig with the supply pressure from which the fit starts, where ``[rig]`` states none: that of a pump.

    Raises InputError where the entry of ``[model.parameters]`` is at fault.
    """
    name = "rig.supply_pressure"
    table = config.model.parameters.get(name)
    if rig.supply_pressure is not None or table is None:
        return rig
    prior = _prior_from_table(table, "Pa", f'{config.path}, key model.parameters."{name}"', stated=None)
    value = prior.start if prior.fixed is None else prior.fixed
    return replace(rig, supply_pressure=value)


def _stated_value(config: PipelineConfig, name: str) -> float | None:
    """Return the value that ``[rig]`` gives to a parameter of the rig."""
    group, _, key = name.partition(".")
    rig = config.to_rig()
    value = getattr(rig, key, None) if group == "rig" else None
    return value if isinstance(value, float) else None


def _prior_from_table(table: ParameterTable, unit: str, where: str, stated: float | None) -> ParameterPrior:
    def read(key: str, *, difference: bool = False) -> float | None:
        value = getattr(table, key)
        try:
            return None if value is None else parse_quantity(value, unit, difference=difference)
        except UnitError as error:
            found, _, wanted = str(error).partition("; wanted ")
            raise InputError(f"{where}.{key}", found, wanted, code="E023") from error

    fixed, start, lower, upper = (read(key) for key in ("fixed", "start", "min", "max"))
    sigma, start = read("sigma", difference=True), stated if start is None else start
    lower, upper = -math.inf if lower is None else lower, math.inf if upper is None else upper
    if not lower < upper:
        raise InputError(
            where, f"min {table.min} is not below max {table.max}", "a range", "exchange them", code="E023"
        )
    if start is not None and not lower <= start <= upper:
        raise InputError(
            where, f"start {format_plain(start)} {unit} lies outside min and max", "a start between them", code="E023"
        )
    if sigma is not None and not sigma > 0.0:
        raise InputError(
            f"{where}.sigma", f"{table.sigma}", "a standard deviation above 0", 'or fixed = "..."', code="E023"
        )
    if sigma is not None and start is None:
        raise InputError(
            where, "sigma without start", "the value around which it holds", f'add start = "1 {unit}"', code="E023"
        )
    return ParameterPrior(unit, fixed, start, lower, upper, math.inf if sigma is None else sigma)


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
        require_known([str(kind)], SCENARIO_KINDS, f"{where}.kind", code="E023")
