#!/bin/sh
# pycel 1.0b30, xlcalculator 0.5.0: =-A1^2 is -4 for 2 in the first, =ATAN2(1,2) 0.46 in the second, not 4 and 1.11.
#
# A calibration in a workbook, computed without Excel. pycel makes Python of it, where a power goes before a minus: a
# parabola that begins with -A1^2 bends the other way. xlcalculator passes x and y on as Python has them, y first, and
# an average over a range with an empty cell is an error, as is that cell plus one, where Excel leaves it out or takes
# 0. Nothing warns. Write =-(A1^2), and compare with the values that Excel stored.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pycel==1.0b30 xlcalculator==0.5.0 setuptools==80.9.0
v/bin/python -W ignore - <<'END' | tee seen
import openpyxl
from pycel import ExcelCompiler
from xlcalculator import Evaluator, ModelCompiler

asked = {"-A1^2": 4, "B1-A1^2": 2, "2^3^2": 64, "ATAN2(1,2)": 1.107, "MOD(-1,6)": 5, "AVERAGE(A1:C1)": 4, "C1+1": 1}
book = openpyxl.Workbook()
sheet = book.active
sheet.title = "S"
sheet["A1"], sheet["B1"] = 2, 6
for row, formula in enumerate(asked, 2):
    sheet.cell(row, 1).value = f"={formula}"
book.save("map.xlsx")
compiled = ExcelCompiler("map.xlsx")
evaluator = Evaluator(ModelCompiler().read_and_parse_archive("map.xlsx"))


def shown(value):
    try:
        return f"{float(value):.4g}"
    except (TypeError, ValueError):
        return str(value)


for row, (formula, wanted) in enumerate(asked.items(), 2):
    found = {
        "pycel": compiled.evaluate(f"S!A{row}"),
        "xlcalculator": evaluator.evaluate(f"S!A{row}"),
    }
    print(f"={formula}: Excel {wanted},", ", ".join(f"{name} {shown(value)}" for name, value in found.items()))
END
diff - seen <<'END'
=-A1^2: Excel 4, pycel -4, xlcalculator 4
=B1-A1^2: Excel 2, pycel 2, xlcalculator 2
=2^3^2: Excel 64, pycel 64, xlcalculator 64
=ATAN2(1,2): Excel 1.107, pycel 1.107, xlcalculator 0.4636
=MOD(-1,6): Excel 5, pycel 5, xlcalculator 5
=AVERAGE(A1:C1): Excel 4, pycel 4, xlcalculator #VALUE!
=C1+1: Excel 1, pycel 1, xlcalculator #VALUE!
END
