#!/bin/sh
# PyFluids 4.0.0, CoolProp 8.0.0: the air of ISO 6358 (100 kPa, 20 degC, 65 %) in four ways, of which one is 1.182 kg/m3.
#
# CoolProp's R is a fraction and its V the volume for a kilogram of dry air, so that 1/V is 1 % below the density; Vha is that
# of the air. PyFluids is the same equations in per cent and degrees Celsius: 0.65 there is a dry air, 0.6 % too heavy, and
# 293.15 of dry air is 293 degC, half the density; neither raises. Humid air of 65 % at 1 bar that is compressed to 8 bar
# at 20 degC has V and a density like any other, though it would be 509 % humid: the water that condenses is counted as steam.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pyfluids==4.0.0 CoolProp==8.0.0
v/bin/python -W ignore - <<'END' | tee seen
from CoolProp.CoolProp import HAPropsSI
from pyfluids import Fluid, FluidsList, HumidAir, Input, InputHumidAir


def humid(part):
    return HumidAir().with_state(InputHumidAir.pressure(1e5), InputHumidAir.temperature(20), InputHumidAir.relative_humidity(part))


state = ("T", 293.15, "P", 1e5, "R", 0.65)
print(f"CoolProp 1/V {1 / HAPropsSI('V', *state):.4f}, 1/Vha {1 / HAPropsSI('Vha', *state):.4f} kg/m3")
print(f"PyFluids humidity 65 {humid(65).density:.4f}, 0.65 {humid(0.65).density:.4f}, 0 {humid(0).density:.4f} kg/m3")
for temperature in (20, 293.15):
    air = Fluid(FluidsList.Air).with_state(Input.pressure(6e5), Input.temperature(temperature))
    print(f"PyFluids air at 6 bar, temperature {temperature}: {air.density:.3f} kg/m3")
water = HAPropsSI("W", *state)
print(f"compressed to 8 bar: 1/Vha {1 / HAPropsSI('Vha', 'T', 293.15, 'P', 8e5, 'W', water):.4f} kg/m3", end="; ")
try:
    HAPropsSI("R", "T", 293.15, "P", 8e5, "W", water)
except ValueError as error:
    print(str(error).split("value ")[-1])
END
diff - seen <<'END'
CoolProp 1/V 1.1707, 1/Vha 1.1820 kg/m3
PyFluids humidity 65 1.1820, 0.65 1.1888, 0 1.1888 kg/m3
PyFluids air at 6 bar, temperature 20: 7.146 kg/m3
PyFluids air at 6 bar, temperature 293.15: 3.683 kg/m3
compressed to 8 bar: 1/Vha 9.4822 kg/m3; (5.0925) is outside the range of validity: (0) to (1)
END
