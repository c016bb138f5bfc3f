"""Every key of the pipeline file: what it says, its unit, its default and an example; as a page and as JSON schema.

What a key says stands in ``keys.toml``; type, unit, default and choices are those of the models that check the file,
and of the parsers of the tables that stages read themselves.
"""

import json
import tomllib
from collections.abc import Iterable, Iterator
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
from pneucli.physics.effects import catalogue_with_sides
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


SCHEMA_FILE = "pipeline.schema.json"
DIRECTIVE = f"#:schema ./{SCHEMA_FILE}"  # on the first line of a TOML file, as Taplo and its editors read it
_KINDS = {OPEN_LOOP: "open-loop", CLOSED_LOOP: "closed-loop", MONTE_CARLO: "monte-carlo"}


def json_schema(effects: Iterable[str] = ()) -> dict[str, Any]:
    """Return the schema (draft 2020-12); ``effects`` are names to be offered where one is asked for."""
    made = PipelineConfig.model_json_schema(by_alias=True)
    known = all_keys()
    for table, model in table_models().items():
        properties = made["$defs"][model.__name__]["properties"]
        for key in known:
            if key.table == table:
                properties[key.name] |= _description(key)
    made["properties"]["design"] = _object([k for k in known if k.table == "design"])
    kinds = [_object([k for k in known if k.table == table]) for table in _KINDS]
    for kind, name in zip(kinds, _KINDS.values(), strict=True):
        kind["properties"]["kind"] = {"const": name}
        kind["required"] = [] if name == "open-loop" else ["kind"]
    made["properties"]["scenarios"] = {"type": "array", "items": {"anyOf": kinds}}
    offered = {"anyOf": [{"enum": sorted(effects)}, {"type": "string"}]}
    made["$defs"]["ModelTable"]["properties"]["effects"]["items"] = offered
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "pneucli pipeline file"} | {
        key: value for key, value in made.items() if key != "title"
    }


def _description(key: Key) -> dict[str, Any]:
    unit = f" (SI unit: {key.unit})" if key.unit and key.unit != "1" else ""
    return {"description": f"{key.says}{unit}", "examples": [parse_toml_value(key.example)]}


def _object(own: list[Key]) -> dict[str, Any]:
    choices = {key.name: {"enum": [*map(parse_toml_value, key.choices)]} for key in own if key.choices}
    properties = {key.name: _description(key) | choices.get(key.name, {}) for key in own}
    return {"type": "object", "properties": properties, "additionalProperties": False}


def parse_toml_value(text: str) -> Any:
    """Return the value that a piece of TOML stands for."""
    return tomllib.loads(f"value = {text}")["value"]


def schema_text() -> str:
    """Return the schema as JSON."""
    return json.dumps(json_schema(catalogue_with_sides()), indent=1, ensure_ascii=False) + "\n"
