#!/bin/sh
# metricus 1.0.5: 740 ms are 0.5 s, 100 kgf are 0.1 kN, and 1 stone is 0.16 tonnes.
#
# Each pair of units has a factor of its own. Times, and they alone, come in halves of a unit unless `rounded_result=False` is
# stated. Kilograms-force become kilonewtons by 0.001 in place of 0.0098; the way back is right, so that 100 kgf come back as
# 10.2. Newtons become poundals by 0.0074 in place of 7.23, pounds-force dynes by one that is ten times too small. A stone is
# 6.35 kg. Nothing raises; the pressures are right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile metricus==1.0.5
v/bin/python -W ignore - <<'END' | tee seen
import Metricus

ways = (
    ("time", Metricus.time_converter, 740, "millisecond", "second", 0.74),
    ("force", Metricus.force_converter, 100, "kilogram_force", "kilonewton", 0.980665),
    ("time", Metricus.time_converter, 200, "second", "minute", 3.333),
    ("force", Metricus.force_converter, 0.980665, "kilonewton", "kilogram_force", 100),
    ("force", Metricus.force_converter, 10, "newton", "poundal", 72.33),
    ("force", Metricus.force_converter, 1, "pound_force", "dyne", 444822),
    ("mass", Metricus.mass_converter, 1, "stone", "tonne", 0.00635),
    ("pressure", Metricus.pressure_converter, 1, "bar", "pascal", 1e5),
)
for what, convert, number, unit, other, right in ways:
    print(f"{what}: {number:g} {unit} = {convert(number, unit, other):.6g} {other}, by its definition {right:g}")
END
diff - seen <<'END'
time: 740 millisecond = 0.5 second, by its definition 0.74
force: 100 kilogram_force = 0.1 kilonewton, by its definition 0.980665
time: 200 second = 3.5 minute, by its definition 3.333
force: 0.980665 kilonewton = 100 kilogram_force, by its definition 100
force: 10 newton = 0.07375 poundal, by its definition 72.33
force: 1 pound_force = 44482 dyne, by its definition 444822
mass: 1 stone = 0.15747 tonne, by its definition 0.00635
pressure: 1 bar = 100000 pascal, by its definition 100000
END
