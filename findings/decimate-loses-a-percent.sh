#!/bin/sh
# SciPy 1.17.1: `decimate` takes 1.1 % from every level: a vessel at rest at 5 bar is at 4.943 bar.
#
# Its filter is a Chebyshev filter of order 8 with a ripple of 0.05 dB. Of even order such a filter passes a constant at
# the lower end of its ripple, 0.9943, and run forward and backward its square, 0.9886. A pressure that never changes is
# lower by 57 mbar, and with gauge and absolute readings by different parts. The filter of order 7, `ftype="fir"` and
# `resample_poly` keep it. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from scipy import signal

rest = np.full(2000, 5.0)
ways = {
    "decimate": signal.decimate(rest, 10),
    "order 7": signal.decimate(rest, 10, n=7),
    "fir": signal.decimate(rest, 10, ftype="fir"),
    "resample_poly": signal.resample_poly(rest, 1, 10, padtype="line"),
    "every tenth": rest[::10],
}
for name, bar in ways.items():
    print(f"{name:13s} {bar[100]:.3f} bar")
END
diff - seen <<'END'
decimate      4.943 bar
order 7       5.000 bar
fir           5.000 bar
resample_poly 5.000 bar
every tenth   5.000 bar
END
