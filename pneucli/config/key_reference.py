"""Every key of the pipeline file: what it says, its unit, its default and an example; as a page and as JSON schema.

What a key says stands in ``keys.toml``; type, unit, default and choices are those of the models that check the file,
and of the parsers of the tables that stages read themselves.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import fields
from functools import cache
from importlib.resources import files
from types import NoneType
from typing import Any, Literal, NamedTuple, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from pneucli.config.pipeline_tables import PipelineConfig
from pneucli.config.signal_tables import SignalsTable, SignalTable
from pneucli.config.value_types import QuantityReader
from pneucli.quantities import ROTARY_UNITS

OPEN_LOOP, CLOSED_LOOP, MONTE_CARLO = (f"scenarios, kind = {k}" for k in ("open-loop", "closed-loop", "monte-carlo"))


class Key(NamedTuple):
    """One key: the table that it stands in, what it says, unit, default (both may be empty), choices, and an example.

    ``required``: the table cannot do without it. ``example`` is TOML.
    """

    table: str
    name: str
    says: str
    unit: str
    default: str
    choices: tuple[str, ...]
    required: bool
    example: str


@cache
def key_texts() -> dict[str, dict[str, tuple[str, str]]]:
    """Return what each key says, and an example, by table and key."""
    tables = tomllib.loads((files("pneucli.config") / "keys.toml").read_text(encoding="utf-8"))
    return {t: {name: (says, example) for name, (says, example) in own.items()} for t, own in tables.items()}


@cache
def table_models() -> dict[str, type[BaseModel]]:
    """Return the models that check the tables of ``keys.toml``, but for those that stages read themselves."""
    return {table: _model_at(table) for table in key_texts() if table.partition(",")[0] not in ("design", "scenarios")}


def _model_at(table: str) -> type[BaseModel]:
    """Return the model of a table; NAME and PATH stand for any key."""
    model: type[BaseModel] = PipelineConfig
    for part in table.split("."):
        if part in model.model_fields:
            inner = _inner_types(model.model_fields[part].annotation)
            model = next(one for one in inner if isinstance(one, type) and issubclass(one, BaseModel))
        elif model is SignalsTable:
            model = SignalTable
    return model


def _inner_types(annotation: Any) -> Iterator[Any]:
    yield annotation
    for one in get_args(annotation):
        yield from _inner_types(one)


def all_keys() -> list[Key]:
    """Return every key that the pipeline file may have, table after table, in the order of ``keys.toml``.

    A key that ``keys.toml`` lacks has no text; a test asks for it.
    """
    found = [_key_of_field(table, name, field) for table, name, field in _fields()]
    for table, name, unit, default, choices in _keys_of_stages():
        says, example = _entry(table, name)
        found.append(Key(table, name, says, unit, default, choices, False, example))
    order = [*key_texts()]
    return sorted(found, key=lambda key: order.index(key.table))


def _fields() -> Iterator[tuple[str, str, FieldInfo]]:
    for table, model in table_models().items():
        for name, field in model.model_fields.items():
            if f"{table}.{name}" not in table_models() or name in key_texts().get(
                table, {}
            ):  # a table has its own rows
                yield table, field.alias or name, field


def _entry(table: str, name: str) -> tuple[str, str]:
    return key_texts().get(table, {}).get(name, ("", '""'))


def _key_of_field(table: str, name: str, field: FieldInfo) -> Key:
    says, example = _entry(table, name)
    unit = next((part.unit for part in _type_annotations(field) if isinstance(part, QuantityReader)), "")
    unit = ROTARY_UNITS[unit] if name == "moment_of_inertia" else unit
    default = "" if field.is_required() or field.default in (None, PydanticUndefined) else _toml(field.default)
    return Key(table, name, says, unit, default, _choices(field.annotation), field.is_required(), example)


def _type_annotations(field: FieldInfo) -> Iterator[Any]:
    """Yield all statements about a field's type, at any depth."""
    yield from field.metadata
    waiting = [field.annotation]
    while waiting:
        one = waiting.pop()
        yield from getattr(one, "__metadata__", ())
        waiting += [inner for inner in get_args(one) if inner is not NoneType]


def _choices(annotation: Any) -> tuple[str, ...]:
    if get_origin(annotation) is Literal:
        return tuple(_toml(choice) for choice in get_args(annotation))
    return tuple(choice for inner in get_args(annotation) for choice in _choices(inner))


def _toml(value: Any) -> str:
    if isinstance(value, BaseModel):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else f"{value:.10g}" if isinstance(value, float) else str(value)


def _keys_of_stages() -> Iterator[tuple[str, str, str, str, tuple[str, ...]]]:
    """Yield table, key, unit, default and choices of the tables that stages read themselves."""
    from pneucli.closed_loop import robustness, scenarios  # noqa: PLC0415
    from pneucli.controller.laws import LAWS  # noqa: PLC0415
    from pneucli.design import requirements as design  # noqa: PLC0415 - they bring scipy
    from pneucli.simulate import open_loop  # noqa: PLC0415

    choices = design.CHOICES | {"controller": tuple(LAWS)}
    for one in fields(design.Requirements):
        default = "" if one.default is None else _toml(one.default)
        words = tuple(word for word in choices.get(one.name, ()) if isinstance(word, str))
        yield "design", one.name, design.UNITS.get(one.name, ""), default, _quoted(words)
    for name in open_loop.KEYS:
        unit = "V" if name == "values" else open_loop.UNITS.get(name, "")
        yield OPEN_LOOP, name, unit, "", _quoted(open_loop.CHOICES.get(name, ()))
    known = {"reference": scenarios.REFERENCES, "control": scenarios.CONTROLS}
    for name in ("kind", *scenarios.TEXT_KEYS, *scenarios.UNITS):
        yield CLOSED_LOOP, name, scenarios.UNITS.get(name, ""), "", _quoted(known.get(name, ()))
    usual = robustness.MonteCarloSettings()
    for name in robustness.SETTING_KEYS:
        default = str(getattr(usual, name)) if name in ("runs", "seed") else ""
        yield MONTE_CARLO, name, "", default, ()


def _quoted(names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f'"{name}"' for name in names)
