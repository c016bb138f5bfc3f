#!/bin/sh
# openpyxl 3.1.5, python-calamine 0.9.1: stamps of 2 kHz in a sheet lose half of their values, and a clock of 25 h begins a new day.
#
# Excel stores a stamp as days, to half a microsecond. Both readers (and so pandas and polars) round it to whole milliseconds: of stamps
# each 0.1 ms, ten in a row are the same. Halves go to the even millisecond in openpyxl, up in calamine. A time that is written as
# hh:mm:ss.000 is a time of day up to 24 h and a date in 1900 after it, so that a column of 25 h holds two types; as [h]:mm:ss it
# is a duration throughout. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile openpyxl==3.1.5 python-calamine==0.9.1 xlsxwriter==3.3.1
v/bin/python -W ignore - <<'END' | tee seen
import openpyxl
import python_calamine
import xlsxwriter

DAY = 86_400
book = xlsxwriter.Workbook("rig.xlsx")
sheet = book.add_worksheet()
stamp, clock, lasts = (book.add_format({"num_format": kind}) for kind in ("yyyy-mm-dd hh:mm:ss.000", "hh:mm:ss.000", "[h]:mm:ss"))
for row in range(20):
    sheet.write_number(row, 0, 46355.5 + row * 1e-4 / DAY, stamp)
    sheet.write_number(row, 1, (23.5 + row / 10) / 24, clock)
    sheet.write_number(row, 2, (23.5 + row / 10) / 24, lasts)
    sheet.write_number(row, 3, 0.5 + (row + 0.5) * 1e-3 / DAY, clock)
book.close()
found = {
    "openpyxl": list(openpyxl.load_workbook("rig.xlsx").active.iter_rows(values_only=True)),
    "calamine": python_calamine.CalamineWorkbook.from_path("rig.xlsx").get_sheet_by_index(0).to_python(),
}
for reader, rows in found.items():
    stamps, clocks, lasting, halves = zip(*rows, strict=True)
    print(f"{reader}: different stamps {len(set(stamps))} of 20; 0.5, 1.5, 2.5 ms are", *(x.microsecond / 1000 for x in halves[:3]), "ms")
    print(f"  hh:mm:ss.000: {clocks[0]} ({type(clocks[0]).__name__}), then {clocks[19]} ({type(clocks[19]).__name__})")
    print(f"  [h]:mm:ss: {lasting[0]}, then {lasting[19]}")
END
diff - seen <<'END'
openpyxl: different stamps 3 of 20; 0.5, 1.5, 2.5 ms are 0.0 2.0 2.0 ms
  hh:mm:ss.000: 23:30:00 (time), then 1900-01-01 01:24:00 (datetime)
  [h]:mm:ss: 23:30:00, then 1 day, 1:24:00
calamine: different stamps 3 of 20; 0.5, 1.5, 2.5 ms are 1.0 2.0 3.0 ms
  hh:mm:ss.000: 23:30:00 (time), then 1900-01-01 01:24:00 (datetime)
  [h]:mm:ss: 23:30:00, then 1 day, 1:24:00
END
