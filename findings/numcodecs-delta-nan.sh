#!/bin/sh
# numcodecs 0.16.6: one missing reading makes the rest of its chunk missing under the filter Delta; FixedScaleOffset wraps.
#
# Delta, a filter of Zarr that stores differences, is a running sum when read: after one NaN everything is NaN, and what was
# measured there is gone from the file. Infinity does the same. Nor is it lossless for float32: after a fall from 600 123.4 Pa, 0.1 Pa is
# read as 0.125 Pa from there on. FixedScaleOffset to 16 bits with a millibar a bit reads 32.768 bar as -32.768 without a
# word, and NaN as 0.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile numcodecs==0.16.6 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numcodecs
import numpy as np


def back(codec, values):
    return codec.decode(codec.encode(values))


def show(what, values):
    print(f"{what}:", *(f"{value:g}" for value in values))


p1 = np.array([6.0, 6.1, np.nan, 6.3, 6.4, 6.5])
show("Delta, float64", back(numcodecs.Delta("f8"), p1))
show("Delta, float64", back(numcodecs.Delta("f8"), np.array([6.0, np.inf, 6.2, 6.3])))
counts = numcodecs.FixedScaleOffset(offset=0, scale=1000, dtype="f8", astype="i2")
show("FixedScaleOffset, int16, 1 mbar", back(counts, np.array([6.0, 32.767, 32.768, np.nan])))
show("Delta, float32", back(numcodecs.Delta("f4"), np.array([600123.4, 0.1, 0.1], "f4")))
END
diff - seen <<'END'
Delta, float64: 6 6.1 nan nan nan nan
Delta, float64: 6 inf nan nan
FixedScaleOffset, int16, 1 mbar: 6 32.767 -32.768 0
Delta, float32: 600123 0.125 0.125
END
