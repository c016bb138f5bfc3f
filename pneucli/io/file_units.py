"""The units that raw files state: below the header, as a property, or in brackets in the name of a column."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from math import isclose

from pneucli.errors import InputError, UnitError
from pneucli.io.clock import SINCE
from pneucli.io.raw_file import Channel, RawFile, Reader, Repair
from pneucli.units import factor_and_offset, is_count, parse_scaled_unit, parse_unit, same_dimension

_BRACKETED = re.compile(r"([\[(<])([^\[\](){}<>]*(?:\([^()]*\)[^\[\](){}<>]*)?)[\])>]\s*$")
_REMARK = re.compile(r"(\s*[\[(][^\[\]()]*[\])])\s*[;,:]\s*(\w+)$")  # behind a unit: "P1 (bar); AVE"
_AT_END = re.compile(r"[\s,_]([A-Za-z]+\([A-Za-z]+\))$")  # a unit that has brackets of its own: "P1, bar(a)"
NUMBER = r"[-+]?\d+(?:[.,]\d+)?"
UP_TO = r"\s*(?:\.{2,3}|[-–…]|to|bis)\s*"
RANGE = re.compile(rf"(?<![\w.]){NUMBER}{UP_TO}{NUMBER}\s*(?=[^\W\d])")  # 0-10 V
_WITH_STATE = re.compile(r"\[([^\]]+)\]\s*\(([^()]*)\)\s*$")  # "Q [l/min] (ANR)", "p1 [bar] (abs)"
_IN = re.compile(r"(?i)^in (?!lb|oz|h)")  # "Pressure (in bar)", and neither "in lb" nor "in Hg"
_UNIT_LIKE = re.compile(r"(?=.*[A-Za-zµ°%])[\w\s.,@*/^·×²³⁻°%µ-]{1,24}")
_WORDS = (
    "abs absolute rel relative gauge filt filtered mean avg left right top bottom in out front rear soll ist set "
    "actual first second upper lower main signal float double int value real lreal dint uint udint sint usint word bool"
)
_NO_UNITS = frozenset(_WORDS.split())


@dataclass(frozen=True)
class WrittenUnit:
    """A unit as a file writes it: the number in ``unit`` is ``scale`` times that of the column.

    ``unit`` is empty where the text is none that is known; ``certain``: whether the text alone says the scale.
    """

    text: str
    unit: str
    scale: float = 1.0
    certain: bool = True

    @property
    def is_plain(self) -> bool:
        """Whether it is a known unit without a factor."""
        return bool(self.unit) and self.scale == 1.0 and self.certain


def unit_in_file(reader: Reader, place: int) -> WrittenUnit | None:
    """Return the unit that a file states for its column; None where it states none."""
    name = with_unit_last(reader.names[place])
    in_name, at_end, inner = _BRACKETED.search(name), _AT_END.search(name), _WITH_STATE.search(name)
    in_name = None if in_name and in_name[2].isdigit() else in_name  # an element of an array
    of_state = (f"{inner[1]} {inner[2]}", inner[1]) if inner else ()
    texts = [reader.units.get(place), at_end and at_end[1], *of_state, in_name and in_name[2]]
    found = [read_unit(text) for text in texts if text]
    if reader.units.get(place) and is_count(found[0].text):
        return found[0]  # whatever the name says, this is no number in its unit
    known = next((one for one in found if one.unit), None)
    file_unit = next((one for one in found if _is_stated(one.text, in_name)), None)
    return known or file_unit


def unit_in_brackets(name: str) -> str:
    """Return what stands in brackets at the end of a name; empty where nothing does."""
    found = _BRACKETED.search(name)
    return found[2] if found else ""


def with_unit_last(name: str) -> str:
    """Return a name with what stands behind its unit before it.

    >>> with_unit_last("P1 (bar); AVE")
    'P1 AVE (bar)'
    """
    return _REMARK.sub(r" \2\1", name)


def read_unit(text: str) -> WrittenUnit:
    """Return a unit as it is written, known or not; a range, and a date since which it counts, are no part of it."""
    text = _IN.sub("", RANGE.sub("", SINCE.sub("", text).partition("=")[0]))
    try:
        unit, scale, certain = parse_scaled_unit(text)
    except UnitError:
        return WrittenUnit(text.strip(), "")
    return WrittenUnit(text.strip(), unit, scale, certain)


def _is_stated(text: str, in_name: re.Match[str] | None) -> bool:
    """Return whether a text that is no known unit was meant as one: counts, or a short word where units stand."""
    plain = text.strip()
    if is_count(plain):
        return True
    rounded = in_name is not None and in_name[1] == "(" and in_name[2] == text
    words = plain.lower().split()
    if not words or any(word in _NO_UNITS for word in words) or (rounded and len(words) > 1):
        return False
    return _UNIT_LIKE.fullmatch(plain) is not None


def with_unit_of_file(raw: RawFile, name: str, channel: Channel, place: int | None, reader: Reader) -> Channel:
    """Return ``channel`` in the unit that the file states for its column, where the pipeline file states none.

    Raises InputError where that unit is not known, or cannot be the signal's.
    """
    file_unit = None if place is None else unit_in_file(reader, place)
    if file_unit is None or place is None or (channel.si is None and channel.unit is None):
        return channel
    where, column = f"{raw.path}, signal {name}", f'"{reader.names[place]}"'
    if channel.unit is not None:
        if file_unit.unit and _differ(file_unit, channel.unit):
            message = f"the file says {file_unit.text} of {column}; read in {channel.unit}, as stated"
            reader.repairs.append(Repair(name, "unit", 1, message))
        return channel
    if fault := _fault_of_unit(file_unit, channel.si or ""):
        found, mend = fault
        told = f'the file says "{file_unit.text}" of column {column}, {found}'
        raise InputError(where, told, f"a unit such as {channel.si}", f"state {mend}", code="E046")
    factor, offset = factor_and_offset(file_unit.unit, 0.0 if channel.offset else raw.ambient, channel.si)
    reader.repairs.append(Repair(name, "unit-said", 1, f"read in {file_unit.text}, as the file says of {column}"))
    return replace(channel, factor=factor * file_unit.scale, offset=offset + channel.offset)


def _differ(file_unit: WrittenUnit, stated: str) -> bool:
    factor = parse_unit(file_unit.unit).factor * file_unit.scale
    return same_dimension(file_unit.unit, stated) and not isclose(factor, parse_unit(stated).factor, rel_tol=1e-6)


def _fault_of_unit(one: WrittenUnit, si: str) -> tuple[str, str] | None:
    """Return what is wrong with a unit that a file says of a signal, and what to state; None where it can be used."""
    if not one.unit:
        return "which is no known unit", 'unit = "..."' + ", and scale = ... for what one count is" * is_count(one.text)
    if not one.certain:
        stated = f'unit = "{one.unit}" and scale = {one.scale:g} (or its inverse)'
        return "a unit with a factor that may be meant either way", stated
    if not same_dimension(one.unit, si):
        return "and no unit is stated", f'unit = "...", with scale if {one.text} is right'
    return None
