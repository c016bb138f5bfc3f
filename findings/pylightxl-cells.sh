#!/bin/sh
# pylightxl 1.61, openpyxl 3.1.5, XlsxWriter 3.3.1: stamps lose their fraction, 25 h are 1 h, and headings are empty.
#
# Stamps 5 ms apart are read as texts of whole seconds, so a second of readings shares one; a duration of 25 h is the
# text "01:00:00". Of a sheet by openpyxl no text is left, of headings and states alike, as openpyxl writes them into
# the cells and pylightxl looks them up in the list of texts of the book; those of XlsxWriter are read. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pylightxl==1.61 openpyxl==3.1.5 XlsxWriter==3.3.1
v/bin/python -W ignore - <<'END' | tee seen
import datetime

import openpyxl
import pylightxl
import xlsxwriter

start = datetime.datetime(2026, 11, 30, 12, 0, 0, 250000)
rows = [(start + datetime.timedelta(milliseconds=5 * k), datetime.timedelta(hours=25, milliseconds=5 * k)) for k in (0, 1)]
heading = ["stamp", "lasts", "p1 [bar]", "state"]
book = openpyxl.Workbook()
book.active.append(heading)
for stamp, lasts in rows:
    book.active.append([stamp, lasts, 6.25, "moves"])
book.save("openpyxl.xlsx")
with xlsxwriter.Workbook("xlsxwriter.xlsx", {"default_date_format": "yyyy-mm-dd hh:mm:ss.000"}) as book:
    sheet, hours = book.add_worksheet("Sheet"), book.add_format({"num_format": "[h]:mm:ss.000"})
    sheet.write_row(0, 0, heading)
    for line, (stamp, lasts) in enumerate(rows, 1):
        sheet.write_datetime(line, 0, stamp)
        sheet.write_datetime(line, 1, lasts, hours)
        sheet.write_row(line, 2, [6.25, "moves"])
for name in ("openpyxl", "xlsxwriter"):
    for row in pylightxl.readxl(f"{name}.xlsx").ws("Sheet").rows:
        print(f"{name}:", row)
END
diff - seen <<'END'
openpyxl: ['', '', '']
openpyxl: ['2026/11/30 12:00:00', '01:00:00', 6.25]
openpyxl: ['2026/11/30 12:00:00', '01:00:00', 6.25]
xlsxwriter: ['stamp', 'lasts', 'p1 [bar]', 'state']
xlsxwriter: ['2026/11/30 12:00:00', '01:00:00', 6.25, 'moves']
xlsxwriter: ['2026/11/30 12:00:00', '01:00:00', 6.25, 'moves']
END
