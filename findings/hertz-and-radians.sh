#!/bin/sh
# pint 0.25.3, quantities 0.16.4, cf-units 3.3.1, ansys-units 0.15.0, SymPy 1.14.0: 60 revolutions a minute are 6.28 Hz.
#
# A turn is 6.28 rad and a radian is 1, so that a hertz is taken for a radian per second: a drive that turns once a
# second has 6.28 Hz, one cycle per second too, and a bandwidth of 10 Hz is 10 rad/s, where a controller needs 62.8.
# Each of the five converts without a word; no name for a full turn gives 1 Hz. unyt, openmdao and scipp refuse both,
# as astropy does until `dimensionless_angles` is asked for; then it is 6.28 Hz there as well. Multiply by 2 pi
# yourself.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pint==0.25.3 quantities==0.16.4 cf-units==3.3.1 ansys-units==0.15.0 sympy==1.14.0 unyt==3.2.0 astropy==8.0.2 openmdao==3.45.1 scipp==26.8.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import cf_units
import numpy as np
import pint
import quantities
import scipp
import unyt
from ansys.units import Quantity
from astropy import units
from openmdao.utils.units import convert_units
from sympy.physics import units as symbols

registry = pint.UnitRegistry()
turn, tone = 60 * units.cycle / units.min, 10 * units.Hz
angles = units.dimensionless_angles()
turning = 360 * symbols.degree / symbols.second
asked = {
    "pint": (lambda: registry("60 rpm").m_as("Hz"), lambda: registry("10 Hz").m_as("rad/s")),
    "pint, cycle/s": (lambda: registry("1 cycle/s").m_as("Hz"), lambda: registry("10 Hz").m_as("cycle/s")),
    "quantities": (
        lambda: quantities.Quantity(60, "rpm").rescale("Hz").item(),
        lambda: quantities.Quantity(10, "Hz").rescale("rad/s").item(),
    ),
    "cf-units": (
        lambda: cf_units.Unit("rpm").convert(60.0, "Hz"),
        lambda: cf_units.Unit("Hz").convert(10.0, "rad/s"),
    ),
    "ansys-units": (
        lambda: Quantity(60, "rev min^-1").to("Hz").value,
        lambda: Quantity(10, "Hz").to("rad s^-1").value,
    ),
    "SymPy": (
        lambda: symbols.convert_to(turning, symbols.hertz) / symbols.hertz,
        lambda: symbols.convert_to(10 * symbols.hertz, symbols.second) * symbols.second,
    ),
    "astropy": (lambda: turn.to_value("Hz"), lambda: tone.to_value("rad/s")),
    "astropy, angles": (lambda: turn.to_value("Hz", angles), lambda: tone.to_value("rad/s", angles)),
    "unyt": (
        lambda: unyt.unyt_quantity(60, "rpm").to_value("Hz"),
        lambda: unyt.unyt_quantity(10, "Hz").to_value("rad/s"),
    ),
    "openmdao": (lambda: convert_units(60, "rpm", "Hz"), lambda: convert_units(10, "Hz", "rad/s")),
    "scipp": (
        lambda: scipp.to_unit(scipp.scalar(60.0, unit="rpm"), "Hz").value,
        lambda: scipp.to_unit(scipp.scalar(10.0, unit="Hz"), "rad/s").value,
    ),
}


def said(ask):
    try:
        return f"{float(ask()):.3g}"
    except Exception as error:
        return type(error).__name__


for package, (turns, hertz) in asked.items():
    print(f"{package}: 60 rpm in Hz {said(turns)}, 10 Hz in rad/s {said(hertz)}")
END
diff - seen <<'END'
pint: 60 rpm in Hz 6.28, 10 Hz in rad/s 10
pint, cycle/s: 60 rpm in Hz 6.28, 10 Hz in rad/s 1.59
quantities: 60 rpm in Hz 6.28, 10 Hz in rad/s 10
cf-units: 60 rpm in Hz 6.28, 10 Hz in rad/s 10
ansys-units: 60 rpm in Hz 6.28, 10 Hz in rad/s 10
SymPy: 60 rpm in Hz 6.28, 10 Hz in rad/s 10
astropy: 60 rpm in Hz UnitConversionError, 10 Hz in rad/s UnitConversionError
astropy, angles: 60 rpm in Hz 6.28, 10 Hz in rad/s 10
unyt: 60 rpm in Hz UnitConversionError, 10 Hz in rad/s UnitConversionError
openmdao: 60 rpm in Hz TypeError, 10 Hz in rad/s TypeError
scipp: 60 rpm in Hz UnitError, 10 Hz in rad/s UnitError
END
