#!/bin/sh
# control 0.10.2, casadi 3.8.2: Coulomb friction of 5 N, linearised at rest, is a damping of 5 MN s/m, or nothing.
#
# A mass of 1 kg, viscous friction of 10 N s/m and 5 N times sign(v). `control.linearize` at rest gives a damping of
# 5000010 N s/m, from a step of 1e-6 m/s to one side; at -1e-9 m/s it is 10000010, at 1e-9 m/s 10. casadi gives 10 at all
# of them, as its sign has no slope. A regulator that `lqr` makes from the first has no gain of the speed to speak of, and
# lets the moving axis swing with a damping ratio of 0.16 in place of 0.72. Neither says that there is no slope at that
# place. The step's size, 1e-6, is in no help of `linearize`. Linearise at a speed, or take friction apart.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile control==0.10.2 casadi==3.8.2 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import casadi
import control
import numpy as np


def axis(t, x, u, params):
    return np.array([x[1], u[0] - 5 * np.sign(x[1]) - 10 * x[1]])


plant = control.nlsys(axis, None, inputs=1, states=2, outputs=2)
x, u = casadi.SX.sym("x", 2), casadi.SX.sym("u")
slope = casadi.Function("slope", [x], [casadi.jacobian(casadi.vertcat(x[1], u - 5 * casadi.sign(x[1]) - 10 * x[1]), x)])
for speed in (0.0, 1e-9, -1e-9, 0.1):
    print(f"at {speed:6g} m/s: damping {-control.linearize(plant, [0, speed], [0]).A[1, 1]:.6g} by control,"
          f" {-float(slope([0, speed])[1, 1]):.6g} by casadi")  # fmt: skip
moving = control.linearize(plant, [0, 0.1], [0])
for what, model in (("at rest", control.linearize(plant, [0, 0], [0])), ("moving", moving)):
    gain = control.lqr(model.A, model.B, np.diag([1e6, 1.0]), np.eye(1))[0]
    poles = np.linalg.eigvals(moving.A - moving.B @ gain)
    print(f"lqr of the axis {what}: {gain[0, 0]:.0f} N/m and {gain[0, 1]:.4f} N s/m,"
          f" damping ratio {-poles[0].real / abs(poles[0]):.2f}")  # fmt: skip
END
diff - seen <<'END'
at      0 m/s: damping 5.00001e+06 by control, 10 by casadi
at  1e-09 m/s: damping 10 by control, 10 by casadi
at -1e-09 m/s: damping 1e+07 by control, 10 by casadi
at    0.1 m/s: damping 10 by control, 10 by casadi
lqr of the axis at rest: 1000 N/m and 0.0002 N s/m, damping ratio 0.16
lqr of the axis moving: 1000 N/m and 35.8367 N s/m, damping ratio 0.72
END
