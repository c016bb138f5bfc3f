#!/bin/sh
# SciPy 1.17.1 and pandas 3.1.1: savemat takes dates and writes numbers whose unit is lost.
#
# An array of datetime64 or timedelta64 is converted to float64 as it is, in its own unit, with neither error nor warning:
# 10 ms are 10, 10000 or 1e7 in the file, as the array was in ms, us or ns, and dates count from 1970, where MATLAB's
# numbers of days do from the year 0. Nanoseconds of this century are beyond float64's integers: 10 ms
# are 9999872, and stamps 100 ns apart become equal. A pandas Series is written without its index.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 pandas==3.1.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import pandas as pd
from scipy.io import loadmat, savemat

stamps = np.array(["2026-01-01T00:00:00.000", "2026-01-01T00:00:00.010"], "M8[ms]")


def stored(values):
    savemat("a.mat", {"t": values})
    return loadmat("a.mat")["t"].ravel()


for unit in ("ms", "us", "ns"):
    dates = stored(stamps.astype(f"M8[{unit}]"))
    print(f"{unit}: {dates.dtype}, 10 ms are {dates[1] - dates[0]:.0f} of dates,", end=" ")
    print(f"{stored((stamps - stamps[0]).astype(f'm8[{unit}]'))[1]:.0f} of times since the start")
print("pandas:", f"{np.diff(stored(pd.DatetimeIndex(['2026-01-01', '2026-01-01T00:00:00.010'])))[0]:.0f}")
fine = np.datetime64("2026-01-01T00:00:00", "ns") + np.array([0, 100], "m8[ns]")
print("100 ns apart:", *(f"{one:.0f}" for one in np.diff(stored(fine))))
print("Series:", stored(pd.Series([1.0, 2.0], index=stamps)))
END
diff - seen <<'END'
ms: float64, 10 ms are 10 of dates, 10 of times since the start
us: float64, 10 ms are 10000 of dates, 10000 of times since the start
ns: float64, 10 ms are 9999872 of dates, 10000000 of times since the start
pandas: 10000
100 ns apart: 0
Series: [1. 2.]
END
