#!/bin/sh
# pandas 3.1.1, polars 2.1.0: `interpolate` counts rows, not time, and goes on behind the last reading.
#
# A position that moves with 1 mm/s was read at 0, 10 and 110 ms, with a row without a reading in between at 20 ms.
# By time it is 20 um there; the default of pandas, and polars' only one, put it in the middle of its neighbours, 60.
# A frame with stamps as its index changes nothing, `method="time"` does (`interpolate_by` in polars). Behind the last
# reading pandas repeats it, with each method, so that a sensor that died reads on; polars leaves it empty. After
# `resample` pandas counts rows of both clocks together. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pandas==3.1.1 polars==2.1.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import pandas as pd
import polars as pl

ms = [0, 10, 20, 110, 120, 130]
um = [0.0, 10.0, None, 110.0, None, None]
stamps = pd.to_datetime(ms, unit="ms")
pandas = pd.Series(np.array(um, dtype=float), stamps)
polars = pl.DataFrame({"ms": ms, "um": um})
print("pandas          ", *(f"{value:g}" for value in pandas.interpolate()))
print("pandas, time    ", *(f"{value:g}" for value in pandas.interpolate(method="time")))
print("polars          ", *polars["um"].interpolate())
print("polars, by      ", *polars.select(pl.col("um").interpolate_by("ms"))["um"])
uneven = pd.Series([0.0, 37.0, 61.0, 102.0], pd.to_datetime([0, 37, 61, 102], unit="ms"))
print("pandas, resample", *(f"{value:g}" for value in uneven.resample("50ms").interpolate()))
END
diff - seen <<'END'
pandas           0 10 60 110 110 110
pandas, time     0 10 20 110 110 110
polars           0.0 10.0 60.0 110.0 None None
polars, by       0.0 10.0 20.0 110.0 None None
pandas, resample 0 49 81.5
END
