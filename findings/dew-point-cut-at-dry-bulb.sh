#!/bin/sh
# PsychroLib 2.5.0: the dew point of compressed air is 20 degC if one says that it is 20 degC warm, 30 if 30, and 49 from 50 on.
#
# A compressor draws air of 20 degC and 65 % at 1.013 bar, 9.5 g of water to a kilogram, and fills a vessel at 8 bar. Its pressure dew point,
# at which water falls out in pipes and valves, is 49.4 degC. `GetTDewPointFromHumRatio` cuts it at the dry bulb that it is given besides,
# so that air which must rain looks just saturated, and a dryer seems to suffice at any temperature. The relative humidity of
# the same air is 5.1, without a word. Give a dry bulb above what is sought, as the air has behind the compressor.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile PsychroLib==2.5.0
v/bin/python -W ignore - <<'END' | tee seen
import psychrolib

psychrolib.SetUnitSystem(psychrolib.SI)
ratio = psychrolib.GetHumRatioFromRelHum(20, 0.65, 101325)
print(f"water {1e3 * ratio:.1f} g/kg")
for dry_bulb in (20, 30, 45, 50, 80):
    dew_point = psychrolib.GetTDewPointFromHumRatio(dry_bulb, ratio, 8e5)
    print(f"8 bar, dry bulb {dry_bulb} degC: dew point {dew_point:.1f} degC, relative humidity {psychrolib.GetRelHumFromHumRatio(dry_bulb, ratio, 8e5):.2f}")
END
diff - seen <<'END'
water 9.5 g/kg
8 bar, dry bulb 20 degC: dew point 20.0 degC, relative humidity 5.13
8 bar, dry bulb 30 degC: dew point 30.0 degC, relative humidity 2.83
8 bar, dry bulb 45 degC: dew point 45.0 degC, relative humidity 1.25
8 bar, dry bulb 50 degC: dew point 49.4 degC, relative humidity 0.97
8 bar, dry bulb 80 degC: dew point 49.4 degC, relative humidity 0.25
END
