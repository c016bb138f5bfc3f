#!/bin/sh
# quantulum3 0.10.0: "6,25 bar" is 6 of nothing and 25 bar, "20 Nl/min" 20 of nothing, "2 bar at" bar ampere-turns.
#
# Values are taken out of a data sheet's text. A decimal comma ends a number, so that 6,25 bar is read as 25 bar; a
# normal litre is no unit, and what remains is a number without one, while plain l/min become standard litres. The word
# after a unit may join it: "at" is an ampere-turn, "bar g" bar times gram, though "bar(g)" is bar. A range, 10 to 20,
# is one value of 15 +- 5; a port of G1/4 is 4. Nothing is refused. Ask each quantity for its unit's name before a
# number is used.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile quantulum3==0.10.0 inflect==7.5.0 num2words==0.5.14
v/bin/python -W ignore - <<'END' | tee seen
from quantulum3 import parser

for text in (
    "6.25 bar",
    "6,25 bar",
    "6 bar(g)",
    "6 bar g",
    "100 l/min",
    "20 Nl/min",
    "10 to 20 l/min",
    "2 bar at 50 Hz",
    "port G1/4",
    "5/3-way valve",
):
    found = [f"{one.value:g} {one.unit.name}" for one in parser.parse(text)]
    print(f"{text}: {'; '.join(found) or 'nothing'}")
END
diff - seen <<'END'
6.25 bar: 6.25 bar
6,25 bar: 6 dimensionless; 25 bar
6 bar(g): 6 bar
6 bar g: 6 bar gram
100 l/min: 100 standard litre per minute
20 Nl/min: 20 dimensionless
10 to 20 l/min: 15 standard litre per minute
2 bar at 50 Hz: 2 bar ampere-turn; 50 hertz
port G1/4: 4 dimensionless
5/3-way valve: 1.66667 dimensionless
END
