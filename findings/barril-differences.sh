#!/bin/sh
# barril 2.2.1: a difference of gauge pressures or temperatures is converted as a level: 45 psi between two readings is 411 kPa.
#
# 60 psig less 15 psig is 45, in psig. Asked in pascal, as the force on a piston needs it, it is 411.6 kPa: the ambient
# pressure is added to a difference; 45 psi are 310.3 kPa. So it is with a sum. 60 psig and 1 psi more are 46.3 psig.
# Gauge readings over absolute ones give a ratio of -120, and over gauge ones 0.5, without a word. 20 degC and 5 K are
# -248.15 degC, and a rise of 10 K from 20 degC to 30 degC is 283.15 K. Convert readings to absolute SI units first, and
# compute after that.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile barril==2.2.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
from barril.units import Scalar

high, low = Scalar(60, "psig"), Scalar(15, "psig")
print("one reading:        ", high, "is", f"{high.GetValue('Pa'):.0f} Pa")
print("difference:         ", high - low, "is", f"{(high - low).GetValue('Pa'):.0f} Pa")
print("sum of two:         ", low + low, "is", f"{(low + low).GetValue('psi'):.1f} psi")
print("1 psi more:         ", high + Scalar(1, "psi"))
print("gauge by absolute:  ", Scalar(4, "kgf/cm2(g)") / Scalar(1, "kgf/cm2"))
print("gauge by gauge:     ", Scalar(4, "kgf/cm2(g)") / Scalar(8, "kgf/cm2(g)"))
print("5 K more:           ", Scalar(20, "degC") + Scalar(5, "K"))
rise = Scalar(30, "degC") - Scalar(20, "degC")
print("from 20 to 30 degC: ", rise, "is", rise.GetValue("K"), "K")
END
diff - seen <<'END'
one reading:         60 [psig] is 515010 Pa
difference:          45 [psig] is 411589 Pa
sum of two:          30 [psig] is 44.7 psi
1 psi more:          46.3041 [psig]
gauge by absolute:   -120.382 []
gauge by gauge:      0.5 []
5 K more:            -248.15 [degC]
from 20 to 30 degC:  10 [degC] is 283.15 K
END
