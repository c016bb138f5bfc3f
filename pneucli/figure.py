"""A number with its 95 % interval, and answers as typed trees: one routine writes their JSON, one reads it.

A field of an answer is a key, without the underscore that tells it from a word of Python. Numbers that are not finite
are null; a null is NaN where the type is ``float``.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import cache
from types import NoneType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

T = TypeVar("T")
FIGURE_COLUMNS = "value [see column unit], unit, ci_low [see column unit], ci_high [see column unit]"
_OPTIONAL, _LAYOUT, _FLAT = {"optional": True}, "layout", "flat"


@dataclass(frozen=True)
class Figure:
    """A number, the ends of its 95 % interval, and the SI unit of all three.

    ``determined`` is False where the interval is that of typical values, which hold what the data do not show.
    """

    value: float
    low: float
    high: float
    unit: str = ""
    determined: bool = True

    def excludes(self, value: float) -> bool:
        """Whether the interval excludes a value."""
        return not self.low <= value <= self.high

    @property
    def answer(self) -> dict[str, Any]:
        """The figure in a JSON answer; what is not finite is null.

        >>> Figure(2.0, 1.0, math.inf, "N").answer
        {'value': 2.0, 'unit': 'N', 'ci95': [1.0, None]}
        """
        value, *ends = (float(one) if math.isfinite(one) else None for one in (self.value, self.low, self.high))
        return {"value": value, "unit": self.unit, "ci95": ends}

    @property
    def row(self) -> tuple[float, str, float, float]:
        """The figure in a row of a table, under ``FIGURE_COLUMNS``."""
        return self.value, self.unit, self.low, self.high


def named(one: object, names: str) -> dict[str, Any]:
    """Return attributes by their names.

    >>> named(Figure(2.0, 1.0, 3.0, "N"), "value unit")
    {'value': 2.0, 'unit': 'N'}
    """
    return {name: getattr(one, name) for name in names.split()}


def optional() -> Any:
    """Return the field of a key that is left out of the JSON where its value is None."""
    return field(default=None, metadata=_OPTIONAL)


def laid_out(keys: str) -> dict[str, list[str]]:
    """Return the metadata of a field whose figure has these keys in the JSON, in this order."""
    return {_LAYOUT: keys.split()}


def flat(keys: str = "") -> dict[str, dict[str, str]]:
    """Return the metadata of a field whose keys stand among those of its owner; of a figure ``keys``, in this order.

    A part of an answer that is None has none.

    >>> flat("after:value unit ci95")
    {'flat': {'after': 'value', 'unit': 'unit', 'ci95': 'ci95'}}
    """
    return {_FLAT: {(pair := key.partition(":"))[0]: pair[2] or key for key in keys.split()}}


def to_json(one: Any) -> Any:
    """Return an answer, or a part of one, as JSON has it.

    >>> to_json({"sizes": [Figure(2.0, 1.0, math.inf, "N"), math.nan]})
    {'sizes': [{'value': 2.0, 'unit': 'N', 'ci95': [1.0, None]}, None]}
    """
    if isinstance(one, Figure):
        return one.answer
    if is_dataclass(one):
        return {key: value for f in fields(one) for key, value in _entries(f, getattr(one, f.name))}
    if isinstance(one, Mapping):
        return {key: to_json(value) for key, value in one.items()}
    if isinstance(one, Sequence) and not isinstance(one, str):
        return [to_json(value) for value in one]
    return None if isinstance(one, float) and not math.isfinite(one) else one


def to_answer(one: object) -> dict[str, Any]:
    """Return a whole answer as JSON has it."""
    return dict(to_json(one))


def _entries(one: Field[Any], value: Any) -> Iterator[tuple[str, Any]]:
    if _FLAT in one.metadata and isinstance(value, Figure):
        yield from ((key, value.answer[entry]) for key, entry in one.metadata[_FLAT].items())
    elif _FLAT in one.metadata:
        yield from to_json(value or {}).items()
    elif value is not None or one.metadata != _OPTIONAL:
        yield _key(one), _field_json(one, value)


def _field_json(one: Field[Any], value: Any) -> Any:
    if not isinstance(value, Figure) or _LAYOUT not in one.metadata:
        return to_json(value)
    entries = value.answer | {"determined": value.determined}
    return {key: entries[key] for key in one.metadata[_LAYOUT]}


def read(kind: type[T], content: Mapping[str, Any]) -> T:
    """Return the answer of a kind that JSON holds; keys that it lacks, as those of an older program, are empty."""
    typed: Any = kind
    return kind(**{f.name: _read_field(f, type_, content) for f, type_ in _typed_fields(typed)})


@cache
def _typed_fields(kind: Any) -> list[tuple[Field[Any], Any]]:
    types = get_type_hints(kind)
    return [(one, types[one.name]) for one in fields(kind)]


def _key(one: Field[Any]) -> str:
    return one.name.rstrip("_")


def _read_field(one: Field[Any], kind: Any, content: Mapping[str, Any]) -> Any:
    if _FLAT in one.metadata:
        keys = one.metadata[_FLAT] or {_key(f): _key(f) for f in fields(next(iter(get_args(kind)), kind))}
        there = {entry: content[key] for key, entry in keys.items() if key in content}
        return _read(kind, there if there or kind is Figure else None)
    if _key(one) in content:
        return _read(kind, content[_key(one)])
    return _empty(kind) if one.default is MISSING else one.default


def _read(kind: Any, content: Any) -> Any:
    inner = get_args(kind)
    if content is None:
        return math.nan if kind is float else None
    if NoneType in inner:
        return _read(inner[0], content) if len(inner) == 2 else content
    if kind is Figure:
        low, high = content.get("ci95") or (None, None)
        ends = (-math.inf if low is None else low, math.inf if high is None else high)
        value, unit = _read(float, content.get("value")), content.get("unit") or ""
        return Figure(value, *ends, unit, content.get("determined", True))
    if is_dataclass(kind):
        return read(kind, content)  # type: ignore[arg-type]
    if get_origin(kind) is Mapping:
        return {key: _read(inner[1], value) for key, value in content.items()}
    return [_read(inner[0], value) for value in content] if get_origin(kind) is Sequence else content


def _empty(kind: Any) -> Any:
    """Return what stands for a value that the JSON does not have."""
    if is_dataclass(kind):
        return read(kind, {})  # type: ignore[arg-type]
    empty: dict[Any, Any] = {Mapping: {}, Sequence: [], str: "", float: math.nan, bool: False, int: 0}
    return empty.get(get_origin(kind) or kind)
