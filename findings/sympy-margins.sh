#!/bin/sh
# SymPy 1.14.0: `phase_margin` of a loop that is always stable is -180 degrees.
#
# 1/(s + 1) and 0.5/(s + 1) cross 0 dB at no frequency above 0, so that no phase makes them unstable: control gives inf.
# `phase_margin` of sympy.physics.control gives -180, of which a designer reads that the loop is unstable. 1/(s^2 + s + 1)
# is right, 90. Nothing raises or warns. Compute margins by control, or look at the poles of the closed loop.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile sympy==1.14.0 control==0.10.2 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import control
import sympy as sp
from sympy.abc import s
from sympy.physics.control import TransferFunction, phase_margin

for top, bottom in ((sp.Integer(1), s + 1), (sp.Rational(1, 2), s + 1), (sp.Integer(1), s**2 + s + 1)):
    plant = control.tf([float(top)], [float(one) for one in sp.Poly(bottom, s).all_coeffs()])
    stable = bool((control.feedback(plant).poles().real < 0).all())
    found = phase_margin(TransferFunction(top, bottom, s))
    print(f"({top})/({bottom}): stable {stable}, phase margin {found}, by control {control.margin(plant)[1]:.0f}")
END
diff - seen <<'END'
(1)/(s + 1): stable True, phase margin -180, by control inf
(1/2)/(s + 1): stable True, phase margin -180, by control inf
(1)/(s**2 + s + 1): stable True, phase margin 90, by control 90
END
