#!/bin/sh
# derivative 0.6.3, pysindy 2.1.0: what a clock with jitter does to a velocity, though both are given the stamps.
#
# A swing of 5 Hz at 1 kHz. In derivative, finite differences and the spectral way take the first two stamps for the period of
# all: where the first is 0.1 ms early, and no other, every velocity is 9 % low. With jitter of 0.2 ms on each stamp
# the SmoothedFiniteDifference of pysindy is worse by far than without smoothing, as it smooths sample by sample and then divides by
# the true intervals, which puts the jitter into the velocity. Savitzky-Golay of derivative heeds every stamp.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile derivative==0.6.3 pysindy==2.1.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import pysindy as ps
from derivative import dxdt

even = np.arange(400) * 0.001
early = even.copy()
early[0] -= 1e-4
jitter = even + 2e-4 * np.random.default_rng(0).standard_normal(400)
WINDOW = {"left": 0.005, "right": 0.005, "order": 3}


def error(way, t):
    truth = np.pi * np.cos(10 * np.pi * t)
    velocity = way(0.1 * np.sin(10 * np.pi * t), t)
    return np.std((velocity - truth)[30:-30]) / np.std(truth[30:-30])


def show(what, way):
    print(f"{what:36s}", *(f"{name} {error(way, t):5.1%}" for name, t in (("even", even), ("first early", early), ("jitter", jitter))))


show("derivative finite_difference", lambda x, t: dxdt(x, t, kind="finite_difference", k=1))
show("derivative spectral", lambda x, t: dxdt(x, t, kind="spectral"))
show("derivative savitzky_golay", lambda x, t: dxdt(x, t, kind="savitzky_golay", **WINDOW))
show("pysindy FiniteDifference", lambda x, t: ps.FiniteDifference()(x[:, None], t).ravel())
show("pysindy SmoothedFiniteDifference", lambda x, t: ps.SmoothedFiniteDifference()(x[:, None], t).ravel())
END
diff - seen <<'END'
derivative finite_difference         even  0.0% first early  9.1% jitter 16.6%
derivative spectral                  even  0.0% first early  9.1% jitter 41.1%
derivative savitzky_golay            even  0.0% first early  0.0% jitter  0.0%
pysindy FiniteDifference             even  0.0% first early  0.0% jitter  0.0%
pysindy SmoothedFiniteDifference     even  0.0% first early  0.0% jitter 74.8%
END
