#!/bin/sh
# SymPy 1.14.0: an angle wrapped by Mod is wrong by a turn in C and by turns in Rust; a missing reading is full command in C.
#
# An error of angle is wrapped by Mod(e + pi, 2 pi) - pi. SymPy and NumPy make 2.28 of -4 rad, and leave 2 rad as it is. C
# and C++ call fmod, whose remainder has the sign of its first number: -4 stays, and the axis takes the long way round.
# The code for Rust lacks two parentheses, (x/2 + pi/pi) in place of (x + pi)/(2 pi), and makes -10.57 of 2 rad. Those for
# Octave, Julia and JavaScript are right. A command limited by Max(-10, Min(10, u)) is NaN in NumPy where u is; C has fmax
# and fmin, which pass over a NaN: 10 V. No printer says so.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile sympy==1.14.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import ctypes
import math
import re

import numpy as np
import sympy as sp

libm = ctypes.CDLL(None)
for name in ("fmod", "fmax", "fmin"):
    getattr(libm, name).argtypes, getattr(libm, name).restype = [ctypes.c_double] * 2, ctypes.c_double
calls = {"fmod": libm.fmod, "fmax": libm.fmax, "fmin": libm.fmin, "M_PI": math.pi, "PI": math.pi, "floor": math.floor}

x = sp.symbols("x")
angle = sp.Mod(x + sp.pi, 2 * sp.pi) - sp.pi
limit = sp.Max(-10, sp.Min(10, x))
rust = sp.rust_code(angle)
print("C:   ", sp.ccode(angle), "and", sp.ccode(limit))
print("Rust:", rust)
rust = re.sub(r"(\(.*\))\.floor\(\)", r"floor(\1)", rust.replace("_f64", ""))
for value in (-4.0, 2.0):
    print(f"angle {value:g}: SymPy {float(angle.subs(x, value)):.2f}, NumPy {sp.lambdify(x, angle)(value):.2f},",
          f"C {eval(sp.ccode(angle), calls, {'x': value}):.2f}, Rust {eval(rust, calls, {'x': value}):.2f}")  # fmt: skip
print(f"limit of NaN: NumPy {sp.lambdify(x, limit)(np.nan):g}, C {eval(sp.ccode(limit), calls, {'x': math.nan}):g}")
END
diff - seen <<'END'
C:    fmod(x + M_PI, 2*M_PI) - M_PI and fmax(-10, fmin(10, x))
Rust: x - 2.0*PI*((1_f64/2.0)*x + PI/PI).floor()
angle -4: SymPy 2.28, NumPy 2.28, C -4.00, Rust 2.28
angle 2: SymPy 2.00, NumPy 2.00, C 2.00, Rust -10.57
limit of NaN: NumPy nan, C 10
END
