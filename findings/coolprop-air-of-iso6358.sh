#!/bin/sh
# CoolProp 8.0.0: the density of ISO 6358's reference air (100 kPa, 20 degC, 65 % relative humidity) is not 1.185 kg/m3.
#
# Dry air has 1.1888 kg/m3 there, air of 65 % has 1.1820; 1.185 is air of 37 %. A sonic
# conductance is defined with 1.185, so that a mass flow from C is right whatever the air; a volume flow of the reference
# state that is multiplied by 1.185 is a mass flow that is 0.25 % too large. The inverse of the humid air's "Vda", 1.1707,
# is the mass of dry air in a cubic metre, and no density.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile CoolProp==8.0.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
from CoolProp.CoolProp import HAPropsSI, PropsSI

print(f"dry {PropsSI('D', 'T', 293.15, 'P', 1e5, 'Air'):.4f}")
for humidity in (0.0, 0.37, 0.65, 1.0):
    volumes = [HAPropsSI(key, "T", 293.15, "P", 1e5, "R", humidity) for key in ("Vha", "Vda")]
    print(f"{humidity:4.0%} of humid air {1 / volumes[0]:.4f}, of dry air in it {1 / volumes[1]:.4f}")
END
diff - seen <<'END'
dry 1.1888
  0% of humid air 1.1888, of dry air in it 1.1888
 37% of humid air 1.1850, of dry air in it 1.1785
 65% of humid air 1.1820, of dry air in it 1.1707
100% of humid air 1.1784, of dry air in it 1.1610
END
