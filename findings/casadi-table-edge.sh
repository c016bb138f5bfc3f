#!/bin/sh
# casadi 3.8.2: beyond its table a spline is zero, and a limit with NaN is the other number.
#
# A valve's table from 1 to 4 V, conductance 5 to 9. `interpolant` linear goes on with the last slope. The same with bspline
# is 0 just outside (a valve that shuts), inside both are right, and so is its slope, 0: an optimiser that strays there is not
# brought back. `fmax(NaN, 1)` is 1, `fmin(NaN, 1)` is 1, so that a saturation hides a measurement that is missing.
# The derivative of sign(d) sqrt(|d|), the flow of a leak at equal pressures, is NaN; that of ISO 6358's ellipse in `if_else` is
# right in the choked branch, where the root has no value.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile casadi==3.8.2 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import casadi as ca

x = ca.MX.sym("x")


def show(what, value, *at):
    both = ca.Function("f", [x], [value, ca.gradient(value, x)])
    print(f"{what:22s}", *("{:g}: {:.4g} slope {:.4g} |".format(point, *map(float, both(point))) for point in at))


for kind in ("linear", "bspline"):
    table = ca.interpolant("valve", kind, [[1, 2, 3, 4]], [5, 6, 8, 9])
    show(f"table, {kind}", table(x), 0.99, 2, 4, 4.01)
show("fmax(x, 1)", ca.fmax(x, 1), float("nan"), 2)
show("fmin(x, 1)", ca.fmin(x, 1), float("nan"), 2)
show("sign(x) sqrt(|x|)", ca.sign(x) * ca.sqrt(ca.fabs(x)), -1, 0, 1)
show("choked below 0.3", ca.if_else(x < 0.3, 1, ca.sqrt(1 - ((x - 0.3) / 0.7) ** 2)), 0.2, 0.5, 1)
show("closed above 1", ca.if_else(x < 1, ca.sqrt(1 - x), 0), 0.5, 1, 1.5)
END
diff - seen <<'END'
table, linear          0.99: 4.99 slope 1 | 2: 6 slope 2 | 4: 9 slope 1 | 4.01: 9.01 slope 1 |
table, bspline         0.99: 0 slope 0 | 2: 6 slope 1.833 | 4: 9 slope -0.1667 | 4.01: 0 slope 0 |
fmax(x, 1)             nan: 1 slope nan | 2: 2 slope 1 |
fmin(x, 1)             nan: 1 slope nan | 2: 1 slope 0 |
sign(x) sqrt(|x|)      -1: -1 slope 0.5 | 0: 0 slope nan | 1: 1 slope 0.5 |
choked below 0.3       0.2: 1 slope 0 | 0.5: 0.9583 slope -0.4259 | 1: 0 slope -inf |
closed above 1         0.5: 0.7071 slope -0.7071 | 1: 0 slope 0 | 1.5: 0 slope 0 |
END
