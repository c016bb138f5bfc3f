#!/bin/sh
# pint 0.25.3: "1 1/4 inch" is 0.25 inch, "1 000 Pa" is 0 Pa, "6,25 bar" 625 bar, and "1 h 30 min" 30 h min.
#
# Values of a data sheet, read as text. What stands side by side is multiplied, so that a port of 1 1/4 inch is as
# small as one of 1/4, 2 1/2 is 1, and a space between thousands makes 0; a comma is dropped, wherever it is, in 6,25
# as in 1,000. `Quantity` reads as `ureg(...)` does. unyt refuses all of these, as astropy does but for units with a
# number behind them: 1 h 30 min is 1 h to the power of 30 times min. Nothing warns. Write a decimal point, no spaces
# within a number, and one unit.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pint==0.25.3 astropy==8.0.2 unyt==3.2.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import pint
import unyt
from astropy import units

registry = pint.UnitRegistry()
readers = {
    "pint": registry,
    "pint.Quantity": registry.Quantity,
    "astropy": units.Quantity,
    "unyt": unyt.unyt_quantity.from_string,
}


def said(read, text):
    try:
        return str(read(text))
    except Exception as error:
        return type(error).__name__


for text in ("1.25 inch", "1 1/4 inch", "2 1/2 inch", "6,25 bar", "1,000 Pa", "1 000 Pa", "1 h 30 min", "6 bar 2"):
    print(f"{text}:", ", ".join(f"{name} {said(read, text)}" for name, read in readers.items()))
END
diff - seen <<'END'
1.25 inch: pint 1.25 inch, pint.Quantity 1.25 inch, astropy ValueError, unyt 1.25 inch
1 1/4 inch: pint 0.25 inch, pint.Quantity 0.25 inch, astropy ValueError, unyt ValueError
2 1/2 inch: pint 1.0 inch, pint.Quantity 1.0 inch, astropy ValueError, unyt ValueError
6,25 bar: pint 625 bar, pint.Quantity 625 bar, astropy ValueError, unyt ValueError
1,000 Pa: pint 1000 pascal, pint.Quantity 1000 pascal, astropy ValueError, unyt ValueError
1 000 Pa: pint 0 pascal, pint.Quantity 0 pascal, astropy ValueError, unyt ValueError
1 h 30 min: pint 30 hour * minute, pint.Quantity 30 hour * minute, astropy 1.0 h30 min, unyt ValueError
6 bar 2: pint 12 bar, pint.Quantity 12 bar, astropy 6.0 bar2, unyt ValueError
END
