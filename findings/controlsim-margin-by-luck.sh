#!/bin/sh
# controlsim 0.1.0: a loop that is unstable has a phase margin without end, and a dead time of one period is none.
#
# A cylinder as an integrator with a mode of 20 rad/s and 5 ms of dead time. `gain_phase_margin` asks 10000 frequencies for one whose gain is within
# 0.01 dB of 1. Past the mode the gain falls by more than that from one frequency to the next, so that for some gains there is
# none, and the phase margin is inf; by control 0.10.2 it is negative. The simulated dead time is one period shorter than it is said to
# be, rounded up before. Both make a loop look better than it is. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile controlsim==0.1.0 control==0.10.2 numpy==2.4.6 scipy==1.17.1 matplotlib==3.11.2
v/bin/python -W ignore - <<'END' | tee seen
import control
import numpy as np
from controlsim import ProcessDefinition

LATE = 0.005
omega = np.logspace(-1, 2.5, 20001)
for gain in (5, 10, 20, 30, 50, 70):
    plant = control.tf([gain], [1 / 400, 0.6 / 20, 1, 0])
    _, found, *_ = ProcessDefinition(plant, LATE).gain_phase_margin()
    _, right, *_ = control.margin(control.frd(plant(1j * omega) * np.exp(-1j * omega * LATE), omega))
    print(f"gain {gain}: phase margin {found:.0f} degrees, by control {right:.0f}")
for late, period in ((0.01, 0.01), (0.05, 0.01), (0.25, 0.1)):
    process = ProcessDefinition(control.tf([1], [1, 0]), late, dt=period)
    for _ in range(100):
        process.step(1.0)
    print(f"dead time {late:g} s at a period of {period:g} s: simulated {process.t[-1] - process.y[-1].item():.2f} s")
END
diff - seen <<'END'
gain 5: phase margin 79 degrees, by control 79
gain 10: phase margin 21 degrees, by control 20
gain 20: phase margin -38 degrees, by control -38
gain 30: phase margin inf degrees, by control -52
gain 50: phase margin inf degrees, by control -64
gain 70: phase margin -71 degrees, by control -71
dead time 0.01 s at a period of 0.01 s: simulated 0.00 s
dead time 0.05 s at a period of 0.01 s: simulated 0.04 s
dead time 0.25 s at a period of 0.1 s: simulated 0.20 s
END
