"""Part of ``init``: what raw files cannot tell is asked; cylinders and valves tell it by their part numbers.

A table is CSV with a header. ``part`` may contain ``{stroke}``, the stroke in mm as the part number has it; suffixes
behind a hyphen are options that change none of the values. Quantities are texts with units; what a data sheet does not
state is empty. ``source`` says where the values stand.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import tomlkit

from pneucli.errors import InputError, UnitError, did_you_mean
from pneucli.init.writer import PLACEHOLDER, fields_to_fill_in
from pneucli.units import parse_quantity

COLUMNS = (
    *("part", "kind", "maker", "bore", "rod", "moving_mass", "moving_mass_per_stroke", "arrangement", "valve_kind"),
    *("null", "sonic_conductance", "critical_ratio", "note", "source"),
)
KINDS = ("cylinder", "valve")
_REQUIRED = ("part", "kind", "source")
_UNITS = {"bore": "m", "rod": "m", "moving_mass": "kg", "moving_mass_per_stroke": "kg/m", "null": "V"}


@dataclass(frozen=True)
class Component:
    """One part: its number as it was asked for, its row of the table, and its stroke in mm (empty: not in it)."""

    number: str
    row: Mapping[str, str]
    stroke: str = ""

    @property
    def comment(self) -> str:
        """Part and source, for the lines that it gives."""
        return f"{self.number}: {self.row['source']}"


def find_component(number: str, kind: str, own_table: Path | None = None) -> Component:
    """Return a part by its number; rows of the user's own table come first.

    Args:
        number: The part number.
        kind: ``cylinder`` or ``valve``.
        own_table: A CSV table in the form of ``components.csv``.

    Raises:
        InputError: The part is in no table, or the user's table is at fault.

    """
    shipped = files("pneucli.init").joinpath("components.csv").read_text(encoding="utf-8")
    rows = [*(_own_rows(own_table) if own_table else []), *_rows("components.csv", shipped)]
    of_kind = [row for row in rows if row["kind"] == kind]
    for row in of_kind:
        if (match := _pattern(row["part"]).fullmatch(number)) is not None:
            return Component(number, row, (match.groupdict().get("stroke") or "").lstrip("0"))
    names = sorted({row["part"] for row in of_kind})
    mend = f"{did_you_mean(number, names)}; or a table of your own: --components FILE"
    raise InputError(f"--{kind} {number}", f"no {kind} of this number in the tables", "", mend, code="E031")


def cylinder_values(part: Component) -> dict[str, str]:
    """Return what a cylinder states, by keys of the pipeline file.

    The moving mass is that at zero stroke and, where stated, the part that grows with the stroke. It is that of piston
    and rod alone.
    """
    sizes = {name: part.row[name] for name in (BORE, ROD) if part.row[name]}
    values = values_of(sizes if BORE in sizes else {})
    if part.stroke:
        values["rig.cylinder.stroke"] = f"{part.stroke} mm"
    if part.row["moving_mass"]:
        mass = parse_quantity(part.row["moving_mass"], "kg")
        if part.stroke and part.row["moving_mass_per_stroke"]:
            mass += parse_quantity(part.row["moving_mass_per_stroke"], "kg/m") * 1e-3 * float(part.stroke)
        values["rig.cylinder.moving_mass"] = f"{mass:.6g} kg"
    return values


def valve_values(part: Component) -> dict[str, str]:
    """Return what a valve states, by keys of the pipeline file."""
    keys = {"arrangement": "arrangement", "valve_kind": "kind", "null": "null"}
    return {f"rig.valve.{key}": part.row[column] for column, key in keys.items() if part.row[column]}


def with_components(text: str, parts: Sequence[Component]) -> str:
    """Return the text of a pipeline file with the values of parts in ``[rig]``, each with its source behind it."""
    document = tomlkit.parse(text)
    for part in parts:
        is_cylinder = part.row["kind"] == "cylinder"
        for key, value in (cylinder_values(part) if is_cylinder else valve_values(part)).items():
            item = tomlkit.string(value)
            item.comment(part.comment)
            _table(document, key.split(".")[:-1])[key.split(".")[-1]] = item
        if part.row["sonic_conductance"]:
            stated = f"C = {part.row['sonic_conductance']}, b = {part.row['critical_ratio'] or 'not stated'}"
            _table(document, ["rig", "valve"]).add(tomlkit.comment(f"{part.comment} states {stated}"))
    return tomlkit.dumps(document)


def _table(document: tomlkit.TOMLDocument, path: Sequence[str]) -> Any:
    """Return a table of the document, made where it is missing."""
    here: Any = document
    for name in path:
        if name not in here:
            here.add(name, tomlkit.table())
        here = here[name]
    return here


def _pattern(part: str) -> re.Pattern[str]:
    """Return the pattern of part numbers: the stroke in mm, and options behind a hyphen."""
    before, placeholder, after = part.partition("{stroke}")
    stroke = r"(?P<stroke>\d+)" if placeholder else ""
    return re.compile(f"{re.escape(before)}{stroke}{re.escape(after)}(?:-.*)?", re.IGNORECASE)


def _own_rows(path: Path) -> list[dict[str, str]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8"
        raise InputError(f"--components {path}", f"cannot be read: {reason}", "a CSV table", code="E003") from error
    return list(_rows(str(path), text))


def _rows(where: str, text: str) -> Iterator[dict[str, str]]:
    reader = csv.DictReader(io.StringIO(text))
    unknown = set(reader.fieldnames or ()) - set(COLUMNS)
    missing = set(_REQUIRED) - set(reader.fieldnames or ())
    if unknown or missing:
        found = f'no column "{min(missing)}"' if missing else f'unknown column "{min(unknown)}"'
        raise InputError(where, found, f"columns among {', '.join(COLUMNS)}", "mend the header", code="E042")
    for number, row in enumerate(reader, 2):
        yield _checked(f"{where}, line {number}", {name: (row.get(name) or "").strip() for name in COLUMNS})


def _checked(where: str, row: dict[str, str]) -> dict[str, str]:
    """Return a row whose kind, source and quantities can be used."""
    empty = [name for name in _REQUIRED if not row[name]]
    if empty or row["kind"] not in KINDS:
        found = f"no {empty[0]}" if empty else f'kind "{row["kind"]}"'
        raise InputError(where, found, f"part, kind ({' or '.join(KINDS)}) and source", "mend the row", code="E043")
    for name, unit in _UNITS.items():
        try:
            if row[name]:
                parse_quantity(row[name], unit)
        except UnitError as error:
            raise InputError(f"{where}, column {name}", str(error), f"in {unit}", "mend it", code="E043") from error
    return row


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
    lines = text.splitlines()
    for number, key in fields_to_fill_in(text):
        if key in values:
            before, _, after = re.split(f"({PLACEHOLDER.pattern})", lines[number - 1], maxsplit=1)
            lines[number - 1] = f'{before}"{values[key]}"{after}'
    return "\n".join(lines) + "\n"
