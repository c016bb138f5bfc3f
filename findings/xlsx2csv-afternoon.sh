#!/bin/sh
# xlsx2csv 0.8.6: the afternoon of a recording comes out as the morning, and readings with the digits that a cell shows.
#
# Stamps in the format that openpyxl gives them, `yyyy-mm-dd h:mm:ss`, are written with a clock of twelve hours and
# without am or pm: 13:00 is 01:00, midnight is 12:00, and a recording over noon jumps back by twelve hours. With `hh`
# it is right. Fractions of a second are dropped. A pressure of 6.2537 in a cell of format `0.0` is 6.3, a duty of
# 0.65432 in `0%` is 65%; a clock of 0.5 ms in `0.00` is 0.00 throughout. Nothing warns. Give the XLSX itself; `-i` and
# `--floatformat` keep the digits, but not the hours.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile xlsx2csv==0.8.6 openpyxl==3.1.5
v/bin/python -W ignore - <<'END'
from datetime import datetime

import openpyxl

book = openpyxl.Workbook()
sheet = book.active
sheet.append(["stamp", "stamp hh", "t", "p1", "duty"])
for row, hour in enumerate((0, 11, 12, 13), 2):
    stamp = datetime(2026, 1, 2, hour, 30, 0, 250_000)
    sheet.append([stamp, stamp, row * 0.0005, 6.2537 + row / 1000, 0.65432])
    for column, form in ((2, "yyyy-mm-dd hh:mm:ss"), (3, "0.00"), (4, "0.0"), (5, "0%")):
        sheet.cell(row, column).number_format = form
book.save("log.xlsx")
print("format of a stamp, by openpyxl:", sheet["A2"].number_format)
END
{
    echo "xlsx2csv"
    v/bin/xlsx2csv log.xlsx
    echo "xlsx2csv -i --floatformat %.7g"
    v/bin/xlsx2csv -i --floatformat %.7g log.xlsx
} | tee seen
diff - seen <<'END'
xlsx2csv
stamp,stamp hh,t,p1,duty
2026-01-02 12:30:00,2026-01-02 00:30:00,0.00,6.3,65%
2026-01-02 11:30:00,2026-01-02 11:30:00,0.00,6.3,65%
2026-01-02 12:30:00,2026-01-02 12:30:00,0.00,6.3,65%
2026-01-02 01:30:00,2026-01-02 13:30:00,0.00,6.3,65%
xlsx2csv -i --floatformat %.7g
stamp,stamp hh,t,p1,duty
2026-01-02 12:30:00,2026-01-02 00:30:00,0.001,6.2557,65%
2026-01-02 11:30:00,2026-01-02 11:30:00,0.0015,6.2567,65%
2026-01-02 12:30:00,2026-01-02 12:30:00,0.002,6.2577,65%
2026-01-02 01:30:00,2026-01-02 13:30:00,0.0025,6.2587,65%
END
