#!/bin/sh
# SciPy 1.17.1: `lsim` opens a valve half a sample before the command does.
#
# A command of 0, 0, 1, 1 that a logger wrote each second holds its value until the next row. `lsim` by default draws
# lines between the rows: the valve begins to open at 1 s and is open at 2 s, so that an integrator is ahead by half a
# sample from there on, and a fitted dead time is half a sample too long. `interp=False` holds the command. `dlsim` and
# a plant sampled by "zoh" hold it too. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from scipy import signal

time, command = np.arange(5.0), np.array([0.0, 0.0, 1.0, 1.0, 1.0])
integrator = ([1.0], [1.0, 0.0])
sampled = signal.cont2discrete(integrator, 1.0, "zoh")
ways = {
    "lsim": signal.lsim(integrator, command, time)[1],
    "lsim, interp=False": signal.lsim(integrator, command, time, interp=False)[1],
    "zoh and dlsim": signal.dlsim(sampled, command)[1].ravel(),
}
for name, moved in ways.items():
    print(f"{name:18s}", *(f"{value:g}" for value in moved))
END
diff - seen <<'END'
lsim               0 0 0.5 1.5 2.5
lsim, interp=False 0 0 0 1 2
zoh and dlsim      0 0 0 1 2
END
