#!/bin/sh
# SciPy 1.17.1: two channels with nothing in common have a coherence of 1.000 in a record of 256 to 383 samples.
#
# Noise beside other noise. `scipy.signal.coherence` takes segments of 256 samples, half overlapping, so that a record of
# 300 samples is one segment, and one segment is coherent with anything. There is no warning; at 384 samples two segments
# give 0.56 on average, at 10000 0.02. A short record (200) warns of the length, not of the result. Matplotlib's `cohere`
# refuses one segment. So a valve's frequency response from 0.3 s at 1 kHz looks perfect. Choose `nperseg` for ten
# segments or more.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 numpy==2.4.6 matplotlib==3.11.2
v/bin/python -W ignore - <<'END' | tee seen
import warnings

import numpy as np
from matplotlib import mlab
from scipy.signal import coherence

rng = np.random.default_rng(0)
for count in (200, 256, 300, 383, 384, 1000, 10000):
    command, position = rng.standard_normal((2, count))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = coherence(command, position)[1]
    print(f"{count:5d} samples: coherence {found.min():.3f} to {found.max():.3f}, mean {found.mean():.2f}, warnings {len(said)}")
try:
    mlab.cohere(rng.standard_normal(300), rng.standard_normal(300))
except ValueError as error:
    print("Matplotlib, 300 samples:", type(error).__name__)
END
diff - seen <<'END'
  200 samples: coherence 1.000 to 1.000, mean 1.00, warnings 3
  256 samples: coherence 1.000 to 1.000, mean 1.00, warnings 0
  300 samples: coherence 1.000 to 1.000, mean 1.00, warnings 0
  383 samples: coherence 1.000 to 1.000, mean 1.00, warnings 0
  384 samples: coherence 0.002 to 0.995, mean 0.56, warnings 0
 1000 samples: coherence 0.000 to 0.878, mean 0.16, warnings 0
10000 samples: coherence 0.000 to 0.086, mean 0.02, warnings 0
Matplotlib, 300 samples: ValueError
END
