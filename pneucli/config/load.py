"""Read a pipeline file and say everything that is wrong with it at once, each fault with its line and mend."""

import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import BaseModel, Field, PrivateAttr, ValidationError
from pydantic_core import ErrorDetails

from pneucli.config.pipeline_tables import PipelineConfig, RigDescription
from pneucli.config.stage_tables import CheckTable
from pneucli.config.value_types import Name, Table
from pneucli.document import read_toml
from pneucli.errors import InputError, UnitError, did_you_mean, printable
from pneucli.units import MAX_MAGNITUDE, STANDARD_ATMOSPHERE, parse_quantity, same_dimension

Model = TypeVar("Model", bound=BaseModel)
Location = tuple[str | int, ...]
MAX_TABLE_DEPTH = 12  # tables in one another; the format has 4
MAX_SHOWN_CHARACTERS = 80  # characters of what was found
MAX_FAULTS = 20  # faults of one kind listed at once


def load(path: str | Path) -> PipelineConfig:
    """Return the checked pipeline file.

    Raises :class:`InputError` that names file, line and key of every fault, what was found, what is wanted, the mend.
    """
    path = Path(path)
    text, document = read_toml(path)
    return validate(path, document, text)


def load_description(path: str | Path) -> PipelineConfig:
    """Return a checked pipeline file that may have no recordings yet; raises InputError as :func:`load` does."""
    path = Path(path)
    text, document = read_toml(path)
    return validate(path, document, text, RigDescription)


def validate(
    path: Path, document: dict[str, Any], text: str = "", model: type[PipelineConfig] = PipelineConfig
) -> PipelineConfig:
    """Return the tables of a pipeline file, checked; ``text`` is the file's, by which faults name their line.

    Raises InputError as :func:`load` does.
    """
    tolerances: dict[str, float] = {}
    context = {"ambient_pressure": _ambient(document), "rotary": is_rotary(document), "tolerances": tolerances}
    config = validate_as(model, path, document, text, context)
    config._path, config._document, config._rotary = path, document, is_rotary(document)
    config._tolerances = tolerances
    return config


def validate_as(
    model: type[Model], path: Path, document: dict[str, Any], text: str, context: Mapping[str, Any] | None = None
) -> Model:
    """Return the tables of a TOML file as ``model``; raises InputError as :func:`load` does."""
    unfit = islice(_structural_faults(document), MAX_FAULTS)
    if faults := [
        InputError(_where(path, text, key), found, wanted, mend, code="E023") for key, found, wanted, mend in unfit
    ]:
        raise join_faults(path, faults)
    try:
        return model.model_validate(document, context=dict(context or {}))
    except ValidationError as error:
        faults = _faults(path, text, document, error, model)
        raise join_faults(path, faults) from error


def join_faults(path: Path, faults: Sequence[InputError]) -> InputError:
    """Return one error that holds all ``faults``."""
    return faults[0] if len(faults) == 1 else InputError(str(path), f"{len(faults)} faults", faults=faults, code="E029")


def _structural_faults(document: Mapping[str, Any]) -> Iterator[tuple[Location, str, str, str]]:
    """Yield key, found, wanted and mend of what no table may hold, so that no reader of one need think of it."""
    waiting: list[tuple[Location, Any]] = [((), document)]
    while waiting:
        key, value = waiting.pop()
        if len(key) > MAX_TABLE_DEPTH:
            yield key, "tables in tables without end", "the keys that the documentation names", "mend that line"
        elif isinstance(value, dict):
            waiting += [((*key, name), inner) for name, inner in reversed(value.items())]
            yield from (
                (key, f'"{n}" is no name of a key', "a text that can be printed", "")
                for n in value
                if _has_control_characters(n)
            )
        elif isinstance(value, list):
            waiting += [((*key, number), inner) for number, inner in reversed([*enumerate(value)])]
        elif isinstance(value, str) and _has_control_characters(value) and (value != "\t" or key[-1] != "delimiter"):
            yield (
                key,
                f"{value[:MAX_SHOWN_CHARACTERS]!r} holds control characters",
                "a text that can be printed",
                "take them out",
            )
        elif isinstance(value, int | float) and not abs(value) <= (limit := _limit(key)):
            yield key, _abbreviated(value), f"a number up to {limit:g}", ""


def _limit(key: Location) -> float:
    """Return how large a number may be; marks of missing values may be as large as instruments write them."""
    return sys.float_info.max if "missing" in key else MAX_MAGNITUDE


def _has_control_characters(text: str) -> bool:
    return printable(text) != text


def _where(path: Path, text: str, key: Location) -> str:
    if not key:
        return str(path)
    name = ".".join(str(part + 1) if isinstance(part, int) else part for part in key)
    return f"{path}, line {line_of(text, key)}, key {name[:MAX_SHOWN_CHARACTERS]}"


def _document_key(location: Location, document: Any) -> Location:
    """Return ``location`` as far as the document goes, and one key further: without the names of pydantic's types."""
    for depth, part in enumerate(location):
        try:
            document = document[part]
        except (KeyError, IndexError, TypeError):
            return tuple(location[: depth + isinstance(document, dict)])
    return tuple(location)


def _told_key(location: Location, message: str, text: str, document: Mapping[str, Any]) -> Location:
    """Return the key below ``location`` that a fault of a table, or between tables, names first; else ``location``.

    Of a key that several recordings have, it is that of the recording that is named.
    """
    below = [key for key in _line_numbers(text) if key[: len(location)] == location and len(key) > len(location)]
    recordings = document.get("recordings", [])
    told = [n for n, one in enumerate(recordings) if str(one.get("name") or one.get("file")) in message]
    for word in re.findall(r"(?<![\w./-])(?!a\b)[a-z][\w-]*(?![\w/.-]*[\w/])", message):
        if named := [key for key in below if key[-1] == word]:
            return min(named, key=lambda key: key[0] == "recordings" and key[1] not in told)
    return location


def _ambient(document: Mapping[str, Any]) -> float:
    """Return the pressure that gauge values stand on; a fault in it is reported by the model itself."""
    try:
        return parse_quantity(document["rig"]["ambient_pressure"], "Pa")
    except (KeyError, TypeError, UnitError):
        return STANDARD_ATMOSPHERE


def is_rotary(document: Mapping[str, Any]) -> bool:
    """Return whether the axis turns: by the unit of its position, or a moment of inertia; no fault is reported here."""
    rig = document.get("rig", {})
    cylinder = rig.get("cylinder", {}) if isinstance(rig, dict) else {}
    if isinstance(cylinder, dict) and "moment_of_inertia" in cylinder:
        return True
    tables = document.get("recordings", [])
    tables = [document, *(one for one in tables if isinstance(one, dict))] if isinstance(tables, list) else [document]
    signals = [one["signals"] for one in tables if isinstance(one.get("signals"), dict)]
    described = [one[name] for one in signals for name in ("x", "x_ref") if isinstance(one.get(name), dict)]
    return any(_measures_angles(one.get("unit")) for one in described)


def _measures_angles(unit: Any) -> bool:
    try:
        return isinstance(unit, str) and unit.strip() not in ("", "1", "-", "%") and same_dimension(unit, "rad")
    except UnitError:
        return False


def _faults(
    path: Path, text: str, document: Mapping[str, Any], error: ValidationError, model: type[BaseModel]
) -> list[InputError]:
    """Return a fault a key; a key that may be of several types has as many details, which become one."""
    faults: dict[Location, InputError] = {}
    for detail in error.errors(include_url=False):
        key = _document_key(detail["loc"], document)
        fault = _fault(path, text, document, key, detail, model)
        if key in faults:
            faults[key].wanted += f", or {fault.wanted}"
        else:
            faults[key] = fault
    return list(faults.values())


def _fault(
    path: Path,
    text: str,
    document: Mapping[str, Any],
    location: Location,
    detail: ErrorDetails,
    model: type[BaseModel],
) -> InputError:
    kind, value = detail["type"], _abbreviated(detail["input"])
    where = _where(
        path, text, _told_key(location, detail["msg"], text, document) if kind == "value_error" else location
    )
    if kind == "extra_forbidden":
        return InputError(
            where, "unknown key", "", did_you_mean(str(location[-1]), keys_at(location[:-1], model)), code="E021"
        )
    if kind == "missing":
        return InputError(where, "missing", _choices(location, model), f'add "{location[-1]}"', code="E022")
    if kind == "literal_error":
        expected = str((detail.get("ctx") or {}).get("expected", ""))
        known = re.findall(r"'([^']*)'", expected)
        mend = did_you_mean(str(detail["input"])[:MAX_SHOWN_CHARACTERS], known) if known else ""
        return InputError(where, value, expected, mend, code="E023")
    if kind == "value_error":
        found, _, wanted = detail["msg"].removeprefix("Value error, ").partition("; wanted ")
        return InputError(where, found, wanted, code="E023")
    if kind in ("model_type", "dict_type"):
        return InputError(where, value, "a table", _mend_of_table(location, detail["input"], model), code="E023")
    blank = kind == "string_pattern_mismatch"  # the one pattern that there is
    wanted = "a text that is not blank" if blank else detail["msg"].replace("Input should be", "").strip()
    return InputError(where, value, wanted, code="E023")


def _abbreviated(value: Any) -> str:
    """Return a value as the file may have it, and no more of it than tells which."""
    text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= MAX_SHOWN_CHARACTERS else f"{text[:MAX_SHOWN_CHARACTERS]}..."


def _mend_of_table(location: Location, value: Any, model: type[BaseModel]) -> str:
    """Return how to write the table at ``location``: inline where it is one of several below a table."""
    keys = keys_at(location, model) or keys_at(location[:-1], model)  # of a table whose keys are free: its entries'
    if len(location) > 1 and keys and not isinstance(value, list):
        others = f", or another of its keys: {', '.join(keys[1:])}" if keys[1:] else ""
        return f"write {{ {keys[0]} = {_abbreviated(value)} }}{others}"
    return f"write [{'.'.join(map(str, location))}] on a line of its own, its keys below"


def _choices(location: Location, model: type[BaseModel]) -> str:
    fields = _model_at(location[:-1], model)
    field = fields.model_fields.get(str(location[-1])) if fields else None
    choices = get_args(field.annotation) if field else ()
    return " or ".join(f'"{choice}"' for choice in choices if isinstance(choice, str))


def keys_at(location: Location, model: type[BaseModel] = PipelineConfig) -> list[str]:
    """Return the keys that the table at ``location`` may have; none where there is no such table."""
    table = _model_at(location, model)
    return [field.alias or name for name, field in table.model_fields.items()] if table else []


def _model_at(location: Location, model: type[BaseModel]) -> type[BaseModel] | None:
    """Return the model that describes the table at ``location``."""
    table: type[BaseModel] | None = model
    for part in location:
        if isinstance(part, int) or table is None:
            continue
        by_key = {field.alias or name: field for name, field in table.model_fields.items()}
        table = _model_in(by_key[part].annotation) if part in by_key else None
    return table


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for inner in get_args(annotation) if (found := _model_in(inner))), None)


_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\]]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"""^\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=""")


def line_of(text: str, location: Location) -> int:
    """Return the line (from 1) of ``text`` that comes closest to the key at ``location``."""
    lines, keys = _line_numbers(text), tuple(location)
    return next((lines[keys[:depth]] for depth in range(len(keys), 0, -1) if keys[:depth] in lines), 1)


@lru_cache(maxsize=4)
def _line_numbers(text: str) -> dict[tuple[str | int, ...], int]:
    """Return the first line (from 1) of every table and key."""
    lines: dict[tuple[str | int, ...], int] = {}
    counts: dict[tuple[str, ...], int] = {}
    table: list[str | int] = []
    for number, line in enumerate(text.splitlines(), 1):
        here = table
        if header := _HEADER.match(line):
            table = here = _with_table_numbers(_key_parts(header[2]), counts, new=header[1] == "[[")
        elif key := _KEY.match(line):
            here = [*table, *_key_parts(key[1])]
        for depth in range(1, len(here) + 1):
            lines.setdefault(tuple(here[:depth]), number)
    return lines


def _key_parts(dotted: str) -> list[str]:
    return [bare or quoted for quoted, bare in re.findall(r"""["']([^"']*)["']|([\w-]+)""", dotted)]


def _with_table_numbers(parts: Sequence[str], counts: dict[tuple[str, ...], int], *, new: bool) -> list[str | int]:
    """Put the running number of each array of tables behind its name."""
    if new:
        counts[tuple(parts)] = counts.get(tuple(parts), -1) + 1
    numbered: list[str | int] = []
    for depth, part in enumerate(parts, 1):
        numbered.append(part)
        if (count := counts.get(tuple(parts[:depth]))) is not None:
            numbered.append(count)
    return numbered


class FleetTable(Table):
    """``[fleet]``: ``alarm_rate`` is the share of false alarms for each rig and comparison, ``reports`` which rigs get
    a report of their own, ``healthy`` how many of each rig's first dates are stated to be healthy.
    """

    name: Name
    template: Name
    table: Name
    alarm_rate: Annotated[float, Field(gt=0.0, le=0.5)] = 1e-3
    reports: Literal["changed", "all", "none"] = "changed"
    healthy: Annotated[int, Field(ge=1)] = 1


class FleetConfig(Table):
    """The whole fleet file; ``path`` is where it stands."""

    fleet: FleetTable
    checks: dict[str, CheckTable] = Field(default_factory=dict)

    _path: Path = PrivateAttr(default=Path("fleet.toml"))

    @property
    def path(self) -> Path:
        """The file that was read; relative paths in it start in its folder."""
        return self._path


def load_fleet(path: Path) -> FleetConfig:
    """Return the checked fleet file; raises InputError that names line and key of every fault."""
    text, document = read_toml(path)
    config = validate_as(FleetConfig, path, document, text)
    config._path = path.absolute()
    return config
