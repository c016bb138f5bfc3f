#!/bin/sh
# fluids 1.3.1: the flow of air that a Kv lets through (IEC 60534), in the terms of ISO 6358.
#
# Kv = 1 m3/h at 7 bar and 20 degC, xT = 0.7: the flow chokes at p2/p1 = 0.3, at a sonic conductance of 4.51 dm3/(s bar)
# in ISO 6358's litres (1.185 kg/m3). Both follow from xT: with 0.5 it is 3.81 and 0.5, so that one Kv, which is
# measured with water, is no one C. Below choking the curve is no ellipse: of the same C and b, ISO 6358 gives up to 5 %
# less. The library's litres are those of 0 degC and 1.01325 bar, as its documentation says.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile fluids==1.3.1 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
from fluids.control_valve import size_control_valve_g
from scipy.optimize import brentq

NORMAL = 101325 * 28.96e-3 / 8.314462618 / 273.15  # kg/m3 of the library's volume flow
P1, T1 = 7e5, 293.15


def conductance(ratio, xt):
    air = {"T": T1, "MW": 28.96, "mu": 1.82e-5, "gamma": 1.4, "Z": 1.0, "P1": P1, "P2": ratio * P1, "xT": xt}
    flow = brentq(lambda flow: size_control_valve_g(Q=flow, **air) - 1.0, 1e-8, 10.0)
    return flow * NORMAL / 1.185 / P1 * 1e8  # dm3/(s bar)


for xt in (0.7, 0.5):
    sonic, critical = conductance(0.05, xt), 1 - xt
    print(f"xT {xt}: C {sonic:.2f} dm3/(s bar), chokes at {critical:.2f}:", end="")
    print(f" {conductance(critical - 0.01, xt) / sonic:.4f} below, {conductance(critical + 0.03, xt) / sonic:.4f} above")
    for ratio in (0.6, 0.8, 0.9, 0.95):
        ellipse = (1 - ((ratio - critical) / (1 - critical)) ** 2) ** 0.5
        print(f"p2/p1 {ratio}: {conductance(ratio, xt) / sonic:.3f} of it, ISO 6358 {ellipse:.3f}")
END
diff - seen <<'END'
xT 0.7: C 4.51 dm3/(s bar), chokes at 0.30: 1.0000 below, 0.9993 above
p2/p1 0.6: 0.918 of it, ISO 6358 0.904
p2/p1 0.8: 0.725 of it, ISO 6358 0.700
p2/p1 0.9: 0.540 of it, ISO 6358 0.515
p2/p1 0.95: 0.391 of it, ISO 6358 0.371
xT 0.5: C 3.81 dm3/(s bar), chokes at 0.50: 1.0000 below, 0.9986 above
p2/p1 0.6: 0.984 of it, ISO 6358 0.980
p2/p1 0.8: 0.822 of it, ISO 6358 0.800
p2/p1 0.9: 0.626 of it, ISO 6358 0.600
p2/p1 0.95: 0.459 of it, ISO 6358 0.436
END
