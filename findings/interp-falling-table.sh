#!/bin/sh
# NumPy 2.4.6: `interp` over a table that falls gives its ends, not its values.
#
# A calibration that is listed from the highest volts down is a valid table for people, for SciPy and for pandas, which
# sort it. `np.interp` wants rising ones and looks at nothing: between 10 and 0 V all readings are one end of the table.
# `np.interp` with the table reversed is right. Its manual says so; nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from scipy.interpolate import interp1d

volts, bar = np.array([10.0, 7.5, 5.0, 2.5, 0.0]), np.array([8.0, 6.0, 4.0, 2.0, 0.0])
read = np.array([1.0, 3.0, 6.0, 9.0])
print("volts        ", *read)
print("np.interp    ", *np.interp(read, volts, bar))
print("reversed     ", *np.round(np.interp(read, volts[::-1], bar[::-1]), 9))
print("interp1d     ", *np.round(interp1d(volts, bar)(read), 9))
END
diff - seen <<'END'
volts         1.0 3.0 6.0 9.0
np.interp     0.0 0.0 0.0 0.0
reversed      0.8 2.4 4.8 7.2
interp1d      0.8 2.4 4.8 7.2
END
