#!/bin/sh
# pint 0.25.3, astropy 8.0.2, cf-units 3.3.1 (UDUNITS): units of pneumatics that parse, and mean something else.
#
# pint reads "cfm" as a hundredth of a femtometre, "Nm" as a yarn count (1000 m/kg), "mil" as an angle, "slpm" as a power
# (atmosphere times litre per minute, no temperature), and "U/min" (revolutions in German) as enzyme units. The mark of
# a gauge pressure is a gram in all three, "bar(g)" too in pint and UDUNITS. That of an absolute pressure is a year in
# pint and astropy and a hundred square metres in UDUNITS. "oz" is an ounce of mass, or of volume in UDUNITS.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pint==0.25.3 astropy==8.0.2 cf-units==3.3.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import astropy.units
import cf_units
import pint

registry = pint.UnitRegistry()
readers = {
    "pint": lambda text: f"{registry(text).to_base_units():.6g~}",
    "astropy": lambda text: "{0.value:.6g} {0.unit}".format((1 * astropy.units.Unit(text)).si),
    "UDUNITS": lambda text: cf_units.Unit(text).definition,
}
astropy.units.imperial.enable()
for text in ("cfm", "Nm", "mil", "slpm", "U/min", "bar g", "bar(g)", "bar a", "oz"):
    found = []
    for read in readers.values():
        try:
            found.append(read(text))
        except Exception:
            found.append("-")
    print(f"{text:6s} |", " | ".join(found))
END
diff - seen <<'END'
cfm    | 1e-17 m | - | -
Nm     | 1000 m / kg | - | -
mil    | 9.81748e-05 rad | 2.54e-05 m | 2.54e-05 m
slpm   | 1.68875 kg * m ** 2 / s ** 3 | - | -
U/min  | 2.77778e-10 mol / s ** 2 | - | -
bar g  | 100 kg ** 2 / m / s ** 2 | 100 Pa kg | 100 m-1.kg2.s-2
bar(g) | 100 kg ** 2 / m / s ** 2 | - | 100 m-1.kg2.s-2
bar a  | 3.15576e+12 kg / m / s | 3.15576e+12 Pa s | 10000000 m.kg.s-2
oz     | 0.0283495 kg | 0.0283495 kg | 2.957353125e-05 m3
END
