"""Excel: the sheet of a workbook that holds most rows, and those that go on with it, as a text with tabs."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any

from pneucli.errors import InputError
from pneucli.imports import library_of_extra
from pneucli.io.formats.base import ZIP_MAGIC, Format
from pneucli.io.text_layout import is_value
from pneucli.paths import member_names

_DAY_0 = datetime(1899, 12, 31)  # the day on which Excel's clock of hours begins
_FIRST_STAMP = datetime(1900, 3, 1)  # stamps before are hours beyond 24, which a cell in hh:mm:ss has as a date
_ODS_HOURS = re.compile(r"PT(\d+)H(\d+)M(\d+(?:\.\d+)?)S")  # how a cell of ods holds 24 hours and more


def _is_workbook(head: bytes, path: Path) -> bool:
    names = member_names(path) if head.startswith(ZIP_MAGIC) else []
    return "content.xml" in names or any(name.startswith("xl/") for name in names)


def _write_sheet(path: Path, folder: Path) -> Path:
    target = folder / f"{path.stem}.tsv"
    calamine = library_of_extra("python_calamine", "excel", path, "this is an Excel file, and python-calamine")
    workbook = calamine.CalamineWorkbook.from_path(str(path))
    sheets = [workbook.get_sheet_by_name(name).to_python(skip_empty_area=True) for name in workbook.sheet_names]
    longest: list[list[Any]] = max(sheets, key=_numeric_rows, default=[])
    if not _numeric_rows(longest):  # numbers may be written as texts
        longest = max(sheets, key=lambda rows: sum(is_value(str(value)) for row in rows for value in row), default=[])
    if not any(is_value(str(value)) for row in longest for value in row):
        raise InputError(
            str(path), "no sheet of this Excel file holds numbers", "rows of numbers", "export it again", code="E041"
        )
    rows = _together(sheets, longest)
    with target.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, delimiter="\t", lineterminator="\n")
        writer.writerows([_cell(value) for value in row] for row in rows)
    return target


def _together(sheets: Sequence[list[list[Any]]], longest: list[list[Any]]) -> list[list[Any]]:
    """Return the longest sheet with those of its header below it, or with those of other channels beside it."""
    header = _header(longest)
    if len(alike := [sheet for sheet in sheets if any(header) and _header(sheet) == header]) > 1:
        return [row for sheet in alike for row in sheet]
    others = [sheet for sheet in sheets if any(header[:1]) and set(_header(sheet)) & set(header) == {header[0]}]
    beside = [longest, *(sheet for sheet in others if sheet.index(_header(sheet)) == longest.index(header))]
    padded = [sheet + [[""] * len(sheet[0])] * (max(map(len, beside)) - len(sheet)) for sheet in beside]
    return [[cell for row in rows for cell in row] for rows in zip(*padded, strict=True)]


def _numeric_rows(rows: Sequence[Sequence[Any]]) -> int:
    return sum(any(isinstance(value, int | float | datetime) for value in row) for row in rows)


def _header(rows: Sequence[list[Any]]) -> list[Any]:
    """Return the row of most texts."""
    return max((row for row in rows if not _numeric_rows([row])), key=lambda row: sum(map(bool, row)), default=[])


def _cell(value: Any) -> str:
    if isinstance(value, float | int) and not isinstance(value, bool):
        return repr(value)
    stamp = datetime.combine(value, time()) if type(value) is date else value  # midnight comes without its time
    if isinstance(stamp, datetime) and stamp < _FIRST_STAMP:
        value = stamp - _DAY_0
    if isinstance(value, str) and (of_ods := _ODS_HOURS.fullmatch(value)):
        hours, minutes, seconds = map(float, of_ods.groups())
        value = timedelta(hours=hours, minutes=minutes, seconds=seconds)
    if isinstance(value, timedelta):
        hours, rest = divmod(value, timedelta(hours=1))
        minutes, rest = divmod(rest, timedelta(minutes=1))
        return f"{hours:02d}:{minutes:02d}:{rest.total_seconds():09.6f}"
    if isinstance(value, datetime | date | time):
        return value.isoformat(" ") if isinstance(value, datetime) else value.isoformat()
    return str(value).replace("\t", " ").replace("\n", " ").strip()


EXCEL = Format(
    "Excel",
    "Excel (`xlsx`, `xls`, `ods`)",
    magic=(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",),
    recognises=_is_workbook,
    unpack=_write_sheet,
    column="a column of the sheet with most rows; sheets with its header are runs, with its clock further channels",
    extra="excel",
)
