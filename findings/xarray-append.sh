#!/bin/sh
# xarray 2026.9.0, zarr 3.1.6: a run appended to a Zarr store has another clock, no decimals, and the first run's unit.
#
# A first run has stamps of whole seconds, so the store counts whole seconds. A second one, 3 s later and at 1 kHz, is
# appended with `append_dim="time"`: its stamps are written as counts of milliseconds while the store goes on to say
# seconds, so they stand at 3000, 3001 and 3002 s; its warning says that the unit "milliseconds" is taken instead.
# Readings of 6.25 behind whole numbers are rounded, with a warning about missing values; 6.3e5 Pa behind 6.2 bar are
# 630000 bar, without a warning. A clock of floats at the first write is kept.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile xarray==2026.9.0 zarr==3.1.6 numpy==2.4.6 pandas==3.0.6
v/bin/python -W ignore - <<'END' | tee seen
import warnings

import numpy as np
import pandas as pd
import xarray as xr


def append(path, first, second, **keys):
    first.to_zarr(path, zarr_format=2, **keys)
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        second.to_zarr(path, append_dim="time")
    said = {one.category.__name__ for one in seen} & {"UserWarning", "SerializationWarning"}
    return xr.open_zarr(path), " ".join(said) or "nothing"


def run(p1, start="12:00:00", step="1s", **attrs):
    clock = pd.date_range(f"2026-11-30 {start}", periods=3, freq=step)
    return xr.Dataset({"p1": ("time", p1, attrs)}, {"time": clock})


def seconds(read):
    return ((read.time.values - read.time.values[0]) / np.timedelta64(1, "s")).tolist()


first, second = run([6.0, 6.1, 6.2]), run([6.3, 6.4, 6.5], "12:00:03", "1ms")
read, said = append("stamps.zarr", first, second)
print("1 s apart, from 3 s on 1 ms apart:", seconds(read), "warned:", said)
read, said = append("floats.zarr", first, second, encoding={"time": {"dtype": "float64"}})
print("the same, with a clock of floats:", seconds(read), "warned:", said)
read, said = append("numbers.zarr", run([6, 7, 7]), run([6.25, 6.75, 7.5], "12:00:03"))
print("6 7 7, then 6.25 6.75 7.5:", read.p1.values.tolist(), "warned:", said)
read, said = append("units.zarr", run([6.0, 6.1, 6.2], units="bar"), run([6.3e5, 6.4e5, 6.5e5], "12:00:03", units="Pa"))
print("6.2 bar, then 6.3e5 Pa:", read.p1.values[2:4].tolist(), read.p1.units, "warned:", said)
END
diff - seen <<'END'
1 s apart, from 3 s on 1 ms apart: [0.0, 1.0, 2.0, 3000.0, 3001.0, 3002.0] warned: UserWarning
the same, with a clock of floats: [0.0, 1.0, 2.0, 3.0, 3.001, 3.002] warned: nothing
6 7 7, then 6.25 6.75 7.5: [6, 7, 7, 6, 7, 8] warned: SerializationWarning
6.2 bar, then 6.3e5 Pa: [6.2, 630000.0] bar warned: nothing
END
