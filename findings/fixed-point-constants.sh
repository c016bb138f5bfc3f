#!/bin/sh
# fxpmath 0.4.10, apytypes 0.5.1, spfpm 1.8.0, fixedpoint 1.0.1: a gain of 0.001 is 0 where a pressure has 8.8 bits.
#
# A pressure of 6 bar in 8.8 bits times a gain written as a number, as a loop for a controller is tried out. 6.0 * 0.1 is
# 0.586 in fxpmath, 0.609 in apytypes and spfpm: the gain is brought to 8 fractional bits first, cut by the one and
# rounded by the others. An integral gain of 0.001 is 0 in all three, so that the integral stands still. fixedpoint alone
# gives the gain bits of its own. What does not fit: 500 in 8 bits stops at 128 in fxpmath, and wraps to -12 in apytypes,
# as its help says.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile fxpmath==0.4.10 apytypes==0.5.1 spfpm==1.8.0 fixedpoint==1.0.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import FixedPoint as spfpm
from apytypes import APyFixed
from fixedpoint import FixedPoint
from fxpmath import Fxp

pressures = {
    "fxpmath": Fxp(6.0, signed=True, n_word=16, n_frac=8),
    "apytypes": APyFixed.from_float(6.0, int_bits=8, frac_bits=8),
    "spfpm": spfpm.FXfamily(8, 8)(6.0),
    "fixedpoint": FixedPoint(6.0, signed=True, m=8, n=8),
}
for tool, pressure in pressures.items():
    print(f"{tool:10s}", *(f"6 x {gain:g} = {float(pressure * gain):.6g}" for gain in (0.5, 0.1, 0.01, 0.001)), sep="   ")
print("500 in fxpmath :", float(Fxp(500, signed=True, n_word=16, n_frac=8)))
print("500 in apytypes:", float(APyFixed.from_float(500, int_bits=8, frac_bits=8)))
END
diff - seen <<'END'
fxpmath      6 x 0.5 = 3   6 x 0.1 = 0.585938   6 x 0.01 = 0.046875   6 x 0.001 = 0
apytypes     6 x 0.5 = 3   6 x 0.1 = 0.609375   6 x 0.01 = 0.0703125   6 x 0.001 = 0
spfpm        6 x 0.5 = 3   6 x 0.1 = 0.609375   6 x 0.01 = 0.0703125   6 x 0.001 = 0
fixedpoint   6 x 0.5 = 3   6 x 0.1 = 0.6   6 x 0.01 = 0.06   6 x 0.001 = 0.006
500 in fxpmath : 127.99609375
500 in apytypes: -12.0
END
