"""The JSON schema of the pipeline file, by which editors complete keys and mark faults while one types."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable
from typing import Any

from pneucli.config.key_reference import CLOSED_LOOP, MONTE_CARLO, OPEN_LOOP, Key, all_keys, table_models
from pneucli.config.pipeline_tables import PipelineConfig
from pneucli.physics.effects import catalogue_with_sides

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
    properties = {key.name: _description(key) | _choices(key) for key in own}
    return {"type": "object", "properties": properties, "additionalProperties": False}


def _choices(key: Key) -> dict[str, Any]:
    return {"enum": [parse_toml_value(one) for one in key.choices]} if key.choices else {}


def parse_toml_value(text: str) -> Any:
    """Return the value that a piece of TOML stands for."""
    return tomllib.loads(f"value = {text}")["value"]


def schema_text() -> str:
    """Return the schema as JSON."""
    return json.dumps(json_schema(catalogue_with_sides()), indent=1, ensure_ascii=False) + "\n"
