"""Read a pipeline file and say everything that is wrong with it at once, each fault with its line and mend."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from pneucli.config.models import PipelineConfig
from pneucli.errors import InputError, UnitError, did_you_mean
from pneucli.units import STANDARD_ATMOSPHERE, parse_quantity

Location = Sequence[str | int]


def load(path: str | Path) -> PipelineConfig:
    """Return the checked pipeline file.

    Raises :class:`InputError` that names file, line and key of every fault, what was found, what is wanted, the mend.
    """
    path = Path(path)
    text = _text(path)
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(path), f"not valid TOML: {error}", "a TOML file", "see https://toml.io") from error
    try:
        config = PipelineConfig.model_validate(document, context={"ambient_pressure": _ambient(document)})
    except ValidationError as error:
        faults = [_fault(path, text, document, detail) for detail in error.errors(include_url=False)]
        raise join_faults(path, faults) from error
    config._path, config._document = path, document
    return config


def join_faults(path: Path, faults: Sequence[InputError]) -> InputError:
    """Return one error that holds all ``faults``."""
    if len(faults) == 1:
        return faults[0]
    return InputError(str(path), "\n".join([f"{len(faults)} faults", *map(str, faults)]))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        mend = 'check the path, or write a new pipeline with "pneucli init"'
        raise InputError(str(path), "no such file", "a pipeline file", mend) from error
    except IsADirectoryError as error:
        raise InputError(str(path), "a folder", "a pipeline file (TOML)", "name the file in it") from error
    except UnicodeDecodeError as error:
        raise InputError(
            str(path), f"not UTF-8 at byte {error.start}", "UTF-8 text", "save the file as UTF-8"
        ) from error


def _ambient(document: Mapping[str, Any]) -> float:
    """Return the pressure that gauge values stand on; a fault in it is reported by the model itself."""
    try:
        return parse_quantity(document["rig"]["ambient_pressure"], "Pa")
    except (KeyError, TypeError, UnitError):
        return STANDARD_ATMOSPHERE


def _fault(path: Path, text: str, document: Mapping[str, Any], detail: ErrorDetails) -> InputError:
    location = detail["loc"]
    key = ".".join(str(part + 1) if isinstance(part, int) else part for part in location)
    where = f"{path}, line {line_of(text, location)}, key {key}"
    kind, value = detail["type"], detail["input"]
    if kind == "extra_forbidden":
        return InputError(where, "unknown key", "", did_you_mean(str(location[-1]), _keys_at(location[:-1])))
    if kind == "missing":
        return InputError(where, "missing", _wanted(location, document), f'add "{location[-1]}"')
    if kind == "literal_error":
        expected = str((detail.get("ctx") or {}).get("expected", ""))
        return InputError(where, f'"{value}"', expected, did_you_mean(str(value), re.findall(r"'([^']*)'", expected)))
    if kind == "value_error":
        found, _, wanted = detail["msg"].removeprefix("Value error, ").partition("; wanted ")
        return InputError(where, found, wanted)
    return InputError(where, f"{value!r}", detail["msg"].replace("Input should be", "").strip())


def _wanted(location: Location, document: Mapping[str, Any]) -> str:
    fields = _model_at(location[:-1])
    field = fields.model_fields.get(str(location[-1])) if fields else None
    choices = get_args(field.annotation) if field else ()
    return " or ".join(f'"{choice}"' for choice in choices if isinstance(choice, str))


def _keys_at(location: Location) -> list[str]:
    model = _model_at(location)
    return [field.alias or name for name, field in model.model_fields.items()] if model else []


def _model_at(location: Location) -> type[BaseModel] | None:
    """Return the model that describes the table at ``location``."""
    model: type[BaseModel] | None = PipelineConfig
    for part in location:
        if isinstance(part, int) or model is None:
            continue
        by_key = {field.alias or name: field for name, field in model.model_fields.items()}
        model = _model_in(by_key[part].annotation) if part in by_key else None
    return model


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for inner in get_args(annotation) if (found := _model_in(inner))), None)


_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\]]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"""^\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=""")


def line_of(text: str, location: Location) -> int:
    """Return the line (from 1) of ``text`` that comes closest to the key at ``location``."""
    lines, keys = _lines(text), tuple(location)
    return next((lines[keys[:depth]] for depth in range(len(keys), 0, -1) if keys[:depth] in lines), 1)


@lru_cache(maxsize=4)
def _lines(text: str) -> dict[tuple[str | int, ...], int]:
    """Return the first line (from 1) of every table and key."""
    lines: dict[tuple[str | int, ...], int] = {}
    counts: dict[tuple[str, ...], int] = {}
    table: list[str | int] = []
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            table = _numbered(_parts(header[2]), counts, new=header[1] == "[[")
            lines.setdefault(tuple(table), number)
        elif key := _KEY.match(line):
            lines.setdefault((*table, *_parts(key[1])), number)
    return lines


def _parts(dotted: str) -> list[str]:
    return [bare or quoted for quoted, bare in re.findall(r"""["']([^"']*)["']|([\w-]+)""", dotted)]


def _numbered(parts: Sequence[str], counts: dict[tuple[str, ...], int], *, new: bool) -> list[str | int]:
    """Put the running number of each array of tables behind its name."""
    if new:
        counts[tuple(parts)] = counts.get(tuple(parts), -1) + 1
    numbered: list[str | int] = []
    for depth, part in enumerate(parts, 1):
        numbered.append(part)
        if (count := counts.get(tuple(parts[:depth]))) is not None:
            numbered.append(count)
    return numbered
