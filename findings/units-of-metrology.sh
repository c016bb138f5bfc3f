#!/bin/sh
# metrolopy 1.1.1, quantities 0.16.4, ucumvert 0.3.2, OpenMDAO 3.45.1: a torque in nautical miles, and other units of a laboratory.
#
# "Nm" in metrolopy is a nautical mile: 5 Nm convert to 9260 m (a torque is "N m"), as is "NM" in OpenMDAO. "bar g" is bar
# times gram. 20 degC of quantities are 20 K, as each temperature is a difference. UCUM, the units' code of instruments, defines the inch of water
# by the metre of water, 249.089 Pa; ucumvert says 248.840 for it, and 9806.65 for the metre, which do not fit together. Its "bar{gauge}" is
# bar and "L/min{norm}" a litre per minute, as in UCUM whatever stands in braces is a remark; "at", the
# technical atmosphere elsewhere, is 1e-18 tonnes.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile metrolopy==1.1.1 quantities==0.16.4 ucumvert==0.3.2 openmdao==3.45.1 numpy==2.4.6 scipy==1.17.1 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import quantities
from metrolopy import gummy
from openmdao.utils.units import convert_units
from ucumvert import PintUcumRegistry


def show(what, value):
    print(f"{what}: {value:.6g}")


show("metrolopy, 5 Nm in m", float(gummy(5, unit="Nm").convert("m").x))
print("metrolopy, 1 bar g:", gummy(1, unit="bar g"))
show("quantities, 20 degC in K", float(quantities.Quantity(20, "degC").rescale("K")))
show("OpenMDAO, 1 NM in m", convert_units(1, "NM", "m"))
ucum = PintUcumRegistry()
for unit, si in (("[in_i'H2O]", "Pa"), ("m[H2O]", "Pa"), ("bar{gauge}", "Pa"), ("L/min{norm}", "L/min"), ("at", "tonne")):
    show(f"ucumvert, 1 {unit} in {si}", (1 * ucum.from_ucum(unit)).to(si).magnitude)
show("UCUM, the inch of water from its metre", 9806.65 * 0.0254)
END
diff - seen <<'END'
metrolopy, 5 Nm in m: 9260
metrolopy, 1 bar g: 1 bar g
quantities, 20 degC in K: 20
OpenMDAO, 1 NM in m: 1852
ucumvert, 1 [in_i'H2O] in Pa: 248.84
ucumvert, 1 m[H2O] in Pa: 9806.65
ucumvert, 1 bar{gauge} in Pa: 100000
ucumvert, 1 L/min{norm} in L/min: 1
ucumvert, 1 at in tonne: 1e-18
UCUM, the inch of water from its metre: 249.089
END
