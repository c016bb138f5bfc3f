#!/bin/sh
# processpi 0.2.1: one litre an hour and another are 0.0 L/h, an orifice of 0.5 mm2 has no area, 1 L/min is 2 % more than itself.
#
# Quantities are kept in SI units with six decimals, whatever their size. A flow, an area or a diameter of pneumatics is small in them: what
# is below half a millionth is 0, and a flow of litres a minute has two digits. Conversions and sums go through it. Pressures
# and temperatures are large enough to be right. Nothing warns. Reckon in plain numbers.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile processpi==0.2.1 numpy==2.4.6 matplotlib==3.11.2 networkx==3.6.1 plotly==7.1.0 tabulate==0.10.0 CoolProp==8.0.0
v/bin/python -W ignore - <<'END' | tee seen
from processpi.units import Area, Diameter, MassFlowRate, Pressure, VolumetricFlowRate

ways = (
    (Pressure, 6, "bar", "Pa", 6e5),
    (VolumetricFlowRate, 100, "L/min", "m3/s", 1.66667e-3),
    (VolumetricFlowRate, 1, "L/min", "m3/s", 1.66667e-5),
    (VolumetricFlowRate, 1, "L/h", "L/min", 1.66667e-2),
    (MassFlowRate, 1, "g/h", "kg/s", 2.77778e-7),
    (Area, 0.5, "mm2", "m2", 5e-7),
    (Area, 5.4, "mm2", "cm2", 5.4e-2),
    (Diameter, 0.8, "mm", "m", 8e-4),
)
for kind, number, unit, other, right in ways:
    print(f"{number} {unit} = {kind(number, unit).to(other)}, by definition {right:g}")
print("1 L/h and 1 L/h are", VolumetricFlowRate(1, "L/h") + VolumetricFlowRate(1, "L/h"))
END
diff - seen <<'END'
6 bar = 600000.0 Pa, by definition 600000
100 L/min = 0.001667 m3/s, by definition 0.00166667
1 L/min = 1.7e-05 m3/s, by definition 1.66667e-05
1 L/h = 0.0 L/min, by definition 0.0166667
1 g/h = 0.0 kg/s, by definition 2.77778e-07
0.5 mm2 = 0.0 m2, by definition 5e-07
5.4 mm2 = 0.05 cm2, by definition 0.054
0.8 mm = 0.0008 m, by definition 0.0008
1 L/h and 1 L/h are 0.0 m3/s
END
