#!/bin/sh
# pandas 3.1.1, pyarrow 26.0.1, polars 2.1.0, npTDMS 1.13.0, xarray 2026.9.0: the unit of one stamp by the path it took.
#
# Integers of a stamp are seconds, milliseconds, microseconds or nanoseconds, as the path has it. The same CSV column is in
# microseconds by pandas' own parser; by its engine "pyarrow" in nanoseconds where the stamps have fractions, and in seconds
# where a recording happens to have whole ones. Parquet turns seconds into milliseconds, Feather keeps them. Code that
# divides astype("int64") by 1e9 is wrong by 1000 to 1e9 on all but one, and no path says so.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pandas==3.1.1 pyarrow==26.0.1 polars==2.1.0 npTDMS==1.13.0 xarray==2026.9.0 netCDF4==1.7.5.1.post1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import io

import netCDF4
import numpy as np
import pandas as pd
import polars as pl
import xarray as xr
from nptdms import ChannelObject, TdmsFile, TdmsWriter

for kind, stamps in (("whole", ["00:00:01", "00:00:02"]), ("fraction", ["00:00:01.250", "00:00:01.260"])):
    text = "t\n" + "".join(f"2026-01-01T{stamp}\n" for stamp in stamps)
    print(f"CSV of {kind}:", pd.read_csv(io.StringIO(text), parse_dates=["t"])["t"].dtype, end=", engine pyarrow ")
    print(pd.read_csv(io.StringIO(text), parse_dates=["t"], engine="pyarrow")["t"].dtype, end=", polars ")
    print(pl.read_csv(text.encode(), try_parse_dates=True)["t"].dtype)
frame = pd.DataFrame({"t": np.array(["2026-01-01T00:00:01"], "M8[s]")})
frame.to_parquet("a.parquet")
frame.to_feather("a.feather")
print("seconds by Parquet:", pd.read_parquet("a.parquet")["t"].dtype, "by Feather:", pd.read_feather("a.feather")["t"].dtype)
print("numbers of seconds:", pd.to_datetime([1.5], unit="s").dtype, "of milliseconds:", pd.to_datetime([1500], unit="ms").dtype)
wave = {"wf_increment": 0.01, "wf_start_offset": 0.0, "wf_start_time": np.datetime64("2026-01-01T00:00:01")}
with TdmsWriter("a.tdms") as file:
    file.write_segment([ChannelObject("g", "p1", np.arange(2.0), wave)])
print("npTDMS:", TdmsFile.read("a.tdms").as_dataframe(time_index=True, absolute_time=True).index.dtype)
with netCDF4.Dataset("a.nc", "w") as file:
    file.createDimension("t", 2)
    file.createVariable("t", "f8", ("t",)).units = "seconds since 2026-01-01"
    file["t"][:] = [1, 2]
print("xarray:", xr.open_dataset("a.nc")["t"].dtype)
END
diff - seen <<'END'
CSV of whole: datetime64[us], engine pyarrow datetime64[s], polars Datetime(time_unit='us', time_zone=None)
CSV of fraction: datetime64[us], engine pyarrow datetime64[ns], polars Datetime(time_unit='us', time_zone=None)
seconds by Parquet: datetime64[ms] by Feather: datetime64[s]
numbers of seconds: datetime64[ns] of milliseconds: datetime64[us]
npTDMS: datetime64[ns]
xarray: datetime64[ns]
END
