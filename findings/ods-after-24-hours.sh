#!/bin/sh
# python-calamine 0.9.1: the hours of an ODS sheet are times of day up to 24, and the text "PT24H00M00S" from then on.
#
# A clock in [HH]:MM:SS that passes 24 hours. Cells below are `datetime.time`, which cannot be subtracted; those from 24
# hours on are text as the file has it, so that the column of a long recording is half the one, half the other, and
# whoever takes numbers from it loses the rest. In an XLSX the same clock is durations throughout (excel-stamps.sh). A
# negative time, and one written short as PT0.5S, are text too. pandas with odfpy refuses the sheet. Nothing else warns.
# Save seconds as a number, or give the ODS itself.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile python-calamine==0.9.1 odfpy==1.4.1 pandas==3.1.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import pandas as pd
from odf.opendocument import OpenDocumentSpreadsheet
from odf.table import Table, TableCell, TableRow
from odf.text import P
from python_calamine import CalamineWorkbook


def save(path, spans):
    book, sheet = OpenDocumentSpreadsheet(), Table(name="log")
    head = TableRow()
    head.addElement(TableCell(valuetype="string"))
    head.firstChild.addElement(P(text="t"))
    sheet.addElement(head)
    for span in spans:
        row = TableRow()
        row.addElement(TableCell(valuetype="time", timevalue=span))
        sheet.addElement(row)
    book.spreadsheet.addElement(sheet)
    book.save(path)


save("day.ods", ["PT23H59M59S", "PT23H59M59.500000000S", "PT24H00M00S", "PT49H15M00.25S", "-PT00H00M01S", "PT0.5S"])
for (cell,) in CalamineWorkbook.from_path("day.ods").get_sheet_by_index(0).to_python()[1:]:
    print(type(cell).__name__, cell)
try:
    print(pd.read_excel("day.ods", engine="odf"))
except ValueError as error:
    print("pandas, odf:", type(error).__name__)
END
diff - seen <<'END'
time 23:59:59
time 23:59:59.500000
str PT24H00M00S
str PT49H15M00.25S
str -PT00H00M01S
str PT0.5S
pandas, odf: ValueError
END
