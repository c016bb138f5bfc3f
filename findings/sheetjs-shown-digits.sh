#!/bin/sh
# SheetJS (npm xlsx 0.18.5): `sheet_to_csv` writes the digits that a cell shows; a clock of 1 kHz is 0.00 s in each row.
#
# A CSV made from a sheet has the text of each cell: 6.2537 bar in the format `0.0` is 6.3, 123456.789 Pa in `#,##0` is
# "123,457", a time of 0.0005 s in `0.00` is 0.00 and the next 0.00 too, so that no clock is left; a stamp loses its
# fractions. `sheet_to_json` of the same sheet has all digits. Nothing warns. Pass `rawNumbers: true`; it makes a stamp
# the days since 1899. Or give the XLSX itself.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . xlsx@0.18.5
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile openpyxl==3.1.5
v/bin/python -W ignore - <<'END'
from datetime import datetime

import openpyxl

book = openpyxl.Workbook()
sheet = book.active
sheet.append(["t", "p1", "p2", "stamp"])
for row in range(2, 5):
    stamp = datetime(2026, 1, 2, 3, 4, 5, 200_000 * (row - 1))
    sheet.append([row * 0.0005 - 0.001, 6.2537 + row / 1000, 123456.789 + row, stamp])
    for column, form in ((1, "0.00"), (2, "0.0"), (3, "#,##0")):
        sheet.cell(row, column).number_format = form
book.save("log.xlsx")
END
cat >run.cjs <<'END'
const { readFile, utils } = require("xlsx");

const { Sheet } = readFile("log.xlsx").Sheets;
console.log(utils.sheet_to_csv(Sheet));
console.log("raw:", utils.sheet_to_csv(Sheet, { rawNumbers: true }).split("\n")[2]);
for (const row of utils.sheet_to_json(Sheet)) console.log("json:", row.t, row.p1, row.p2);
END
node run.cjs | tee seen
diff - seen <<'END'
t,p1,p2,stamp
0.00,6.3,"123,459",2026-01-02 3:04:05
0.00,6.3,"123,460",2026-01-02 3:04:05
0.00,6.3,"123,461",2026-01-02 3:04:06
raw: 0.0005,6.2567,123459.789,46024.12784027778
json: 0 6.2557 123458.789
json: 0.0005 6.2567 123459.789
json: 0.001 6.2577 123460.789
END
