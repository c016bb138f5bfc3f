#!/bin/sh
# control 0.10.2: a measured frequency response, asked beyond its last frequency, is a cubic curve: 250 in place of 0.1.
#
# A lag of 10 ms measured from 1 to 100 rad/s in 30 points, `frd(..., smooth=True)`. Within the range it is right to four
# digits. At 200 rad/s its gain is 0.73 for 0.45, at 500 rad/s 21 for 0.20, at 1000 rad/s 251 for 0.10: the spline through
# the points goes on. The help speaks of "any frequency within the range", and nothing raises or warns beyond it. So a
# loop around a valve and an axis, measured apart up to other frequencies, has a gain at the crossover that nobody
# measured. Compare the frequency with `omega[-1]` first.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile control==0.10.2 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import control
import numpy as np

plant = control.tf(1, [0.01, 1])
measured = control.frd(plant, np.logspace(0, 2, 30), smooth=True)
for rate in (0.1, 1, 50, 100, 200, 500, 1000):
    true, found = abs(plant(1j * rate)), abs(measured(1j * rate))
    print(f"{rate:6g} rad/s: gain {true:.3f}, from the measured response {found:.3f}")
END
diff - seen <<'END'
   0.1 rad/s: gain 1.000, from the measured response 1.000
     1 rad/s: gain 1.000, from the measured response 1.000
    50 rad/s: gain 0.894, from the measured response 0.894
   100 rad/s: gain 0.707, from the measured response 0.707
   200 rad/s: gain 0.447, from the measured response 0.733
   500 rad/s: gain 0.196, from the measured response 21.426
  1000 rad/s: gain 0.100, from the measured response 251.474
END
