#!/bin/sh
# SIPPY (sippy_unipi 1.0.1): the delay of ARX begins at one sample, and an offset moves the poles.
#
# y(k) = 0.8 y(k-1) + 0.5 u(k-d). The third order of ARX, the delay theta, counts from one sample: theta = 0 finds d = 1. A direct
# path, d = 0, is found by no theta: the gain is -0.03 instead of 2.5, without a warning; N4SID, whose D is zero where nobody
# asks for it, gives 2.0. With u + 5 and y + 6, as volts and pressures stand, the pole of N4SID is 0.99 and that of ARX 0.65,
# as nothing is subtracted where `centering` is not stated; with "MeanVal" both are right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile sippy_unipi==1.0.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from sippy_unipi import system_identification

rng = np.random.default_rng(0)
u = rng.standard_normal(2000)


def plant(delay):
    y = np.zeros(u.size)
    for k in range(2, u.size):
        y[k] = 0.8 * y[k - 1] + 0.5 * u[k - delay]
    return y


def show(what, method, delay, *, u0=0.0, y0=0.0, **keys):
    if method == "ARX":
        model = system_identification(plant(delay) + y0, u + u0, method, **keys).G
        pole, gain = min(model.poles(), key=lambda p: abs(p - 0.8)).real, model.dcgain()
    else:
        model = system_identification(plant(delay) + y0, u + u0, method, SS_fixed_order=1, **keys)
        pole = model.A.item()
        gain = (model.C @ model.B).item() / (1 - pole) + model.D.item()
    print(f"{what:26s} pole {pole:.2f} gain {float(np.squeeze(gain)):5.2f}")


for delay in (0, 1, 2):
    for theta in (0, 1):
        show(f"d {delay}, ARX theta {theta}", "ARX", delay, ARX_orders=[1, 1, theta])
show("d 0, N4SID", "N4SID", 0)
show("d 1, N4SID", "N4SID", 1)
for centering in ("None", "MeanVal"):
    show(f"offset, ARX {centering}", "ARX", 1, u0=5.0, y0=6.0, ARX_orders=[1, 1, 0], centering=centering)
    show(f"offset, N4SID {centering}", "N4SID", 1, u0=5.0, y0=6.0, centering=centering)
END
diff - seen <<'END'
d 0, ARX theta 0           pole 0.80 gain -0.03
d 0, ARX theta 1           pole 0.80 gain -0.02
d 1, ARX theta 0           pole 0.80 gain  2.50
d 1, ARX theta 1           pole 0.80 gain -0.03
d 2, ARX theta 0           pole 0.80 gain -0.02
d 2, ARX theta 1           pole 0.80 gain  2.50
d 0, N4SID                 pole 0.80 gain  2.00
d 1, N4SID                 pole 0.80 gain  2.50
offset, ARX None           pole 0.65 gain  1.20
offset, N4SID None         pole 0.99 gain  1.19
offset, ARX MeanVal        pole 0.80 gain  2.50
offset, N4SID MeanVal      pole 0.80 gain  2.50
END
