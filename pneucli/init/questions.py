"""Part of ``init``: what raw files cannot tell is asked, and written into the pipeline file."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping

from pneucli.errors import InputError, UnitError
from pneucli.units import parse_quantity

Question = tuple[str, str, str]  # name, text, example

BORE, ROD = "bore", "rod"
_AREAS = ("rig.cylinder.piston_area_1", "rig.cylinder.piston_area_2")
_ASKED = {  # by key of the pipeline file: what is asked, an example, and the unit that it has to measure
    "rig.supply_pressure": ("supply pressure before the valve, absolute", "7 bar", "Pa"),
    "rig.vessel.volume": ("volume of the vessel that is filled", "0.4 l", "m^3"),
    BORE: ("bore of the cylinder", "32 mm", "m"),
    ROD: ("diameter of the rod, 0 mm where there is none in chamber 2", "12 mm", "m"),
    "rig.cylinder.stroke": ("stroke of the cylinder", "200 mm", "m"),
}


def questions(keys: Collection[str]) -> list[Question]:
    """Return what is to be asked so that the ``keys`` that wait are filled in; areas follow from bore and rod."""
    asked = []
    for name, (text, example, _) in _ASKED.items():
        wanted = {BORE: _AREAS[:1], ROD: _AREAS[1:]}.get(name, (name,))
        if any(key in keys for key in wanted):
            asked.append((name, text, example))
    return asked


def values_of(answers: Mapping[str, str]) -> dict[str, str]:
    """Return the values of keys of the pipeline file, by key.

    Raises InputError where an answer is no quantity of its kind, or the rod is thicker than the bore.
    """
    found = {name: text for name, text in answers.items() if name not in (BORE, ROD)}
    sizes = {name: _size(name, text) for name, text in answers.items()}
    if BORE in sizes:
        area = math.pi / 4 * sizes[BORE] ** 2
        found[_AREAS[0]] = f"{1e4 * area:.6g} cm^2"
        if ROD in sizes:
            if sizes[ROD] >= sizes[BORE]:
                raise InputError(
                    "rod", f'"{answers[ROD]}"', f"less than the bore, {answers[BORE]}", "answer again", code="E023"
                )
            found[_AREAS[1]] = f"{1e4 * (area - math.pi / 4 * sizes[ROD] ** 2):.6g} cm^2"
    return found


def _size(name: str, text: str) -> float:
    unit = _ASKED[name][2]
    try:
        size = 0.0 if name == ROD and text.strip() == "0" else parse_quantity(text, unit)
    except UnitError as error:
        found = str(error).partition("; wanted ")[0]
        raise InputError(name, found, f"such as {_ASKED[name][1]}", "answer again", code="E023") from error
    if size < 0.0 or (size == 0.0 and name != ROD):
        raise InputError(name, f'"{text}"', f"such as {_ASKED[name][1]}", "answer again", code="E023")
    return size


def with_values(text: str, values: Mapping[str, str]) -> str:
    """Return the text of a pipeline file with the values of keys that wait with a ``?``."""
    table, lines = "", []
    for line in text.splitlines():
        if header := re.match(r"\[+([\w.]+)\]+", line):
            table = header[1]
        key = f"{table}.{line.split('=')[0].strip()}"
        waits = re.search(r'"[^"]*\?[^"]*"', line.split("  #")[0]) if key in values else None
        lines.append(f'{line[: waits.start()]}"{values[key]}"{line[waits.end() :]}' if waits else line)
    return "\n".join(lines) + "\n"
