"""Answers are written to JSON and read from it by one routine, whatever their fields are."""

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import pytest

from pneucli.figure import Figure, flat, laid_out, optional, read, to_json


@dataclass(frozen=True)
class Part:
    """A part with a key that is a word of Python."""

    from_: float
    note: str | None = optional()


@dataclass(frozen=True)
class Whole:
    """An answer of every kind of field."""

    name: str
    error: float
    limit: float | None
    parts: Sequence[Part]
    sizes: Mapping[str, Figure]
    first: Part | None
    rows: Sequence[Sequence[float]]
    held: Figure = field(metadata=laid_out("value ci95 determined"))
    force: Figure = field(metadata=flat("force:value ci95 unit"))


WHOLE = Whole(
    "a",
    math.nan,
    None,
    [Part(1.0), Part(2.0, "b")],
    {"m": Figure(2.0, 1.0, math.inf, "kg")},
    None,
    [[1.0]],
    Figure(0.5, 0.4, 0.6, "", determined=False),
    Figure(5.0, -math.inf, 6.0, "N"),
)
JSON = {
    "name": "a", "error": None, "limit": None, "parts": [{"from": 1.0}, {"from": 2.0, "note": "b"}],
    "sizes": {"m": {"value": 2.0, "unit": "kg", "ci95": [1.0, None]}}, "first": None, "rows": [[1.0]],
    "held": {"value": 0.5, "ci95": [0.4, 0.6], "determined": False},
    "force": 5.0, "ci95": [None, 6.0], "unit": "N",
}  # fmt: skip


def test_fields_are_keys_open_ends_are_null_and_what_is_optional_is_left_out() -> None:
    assert to_json(WHOLE) == JSON
    assert list(to_json(WHOLE)) == list(JSON)


def test_what_was_written_is_read() -> None:
    found = read(Whole, JSON)
    assert math.isnan(found.error)  # a null of a number that is always there
    assert found.limit is None
    assert (found.parts, found.sizes, found.first, found.rows) == (WHOLE.parts, WHOLE.sizes, None, [[1.0]])
    assert (found.held, found.force) == (WHOLE.held, WHOLE.force)


def test_a_key_that_an_older_program_did_not_write_is_empty() -> None:
    found = read(Whole, {"name": "a", "later": 1, "held": JSON["held"]})
    assert (found.name, found.limit, found.parts, found.sizes, found.first) == ("a", None, [], {}, None)


@pytest.mark.parametrize("stage", ["identify", "compare", "diagnose", "plan", "leak", "fleet", "export"])
def test_the_answer_of_each_command_survives_its_json(stage: str) -> None:
    answer = importlib.import_module(f"pneucli.messages.{stage}").Answer
    written = to_json(read(answer, {}))
    assert written["schema"] == ""
    assert to_json(read(answer, written)) == written
