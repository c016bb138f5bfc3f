#!/bin/sh
# h5netcdf 1.8.2, netCDF4 1.7.5: what is written like netCDF4 reads counts, and readings that nobody wrote are 0 bar.
#
# `h5netcdf.legacyapi` has the names of netCDF4. Its variables are stored counts, 6000 for 6 bar, with the fill value
# -32768 among them, where those of netCDF4 are scaled and masked. In `h5netcdf.File`, its own API, a dimension that
# grew before its last reading came holds 0 there, which netCDF4 reads as a reading; netCDF4 and the legacy API fill
# with a value that means missing. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile h5netcdf==1.8.2 netCDF4==1.7.5.1.post1 h5py==3.16.0 xarray==2026.9.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import h5netcdf.legacyapi
import netCDF4
import numpy as np

with netCDF4.Dataset("counts.nc", "w") as file:
    file.createDimension("time", 3)
    p1 = file.createVariable("p1", "i2", ("time",), fill_value=-32768)
    p1.scale_factor = 0.001
    p1[:] = np.ma.masked_invalid([6.0, np.nan, 6.25])
for library in (netCDF4, h5netcdf.legacyapi):
    with library.Dataset("counts.nc") as file:
        print(f"{library.__name__} reads counts:", *file.variables["p1"][:])
for library in (netCDF4, h5netcdf.legacyapi):
    with library.Dataset("short.nc", "w") as file:
        file.createDimension("time", 3)
        file.createVariable("p1", "f8", ("time",))[:2] = np.array([6.0, 6.1])
    with netCDF4.Dataset("short.nc") as file:
        print(f"{library.__name__} writes two of three:", *file.variables["p1"][:])
with h5netcdf.File("short.nc", "w") as file:
    file.dimensions = {"time": None}
    file.resize_dimension("time", 2)
    file.create_variable("p1", ("time",), "f8")[:] = np.array([6.0, 6.1])
    file.resize_dimension("time", 3)
with netCDF4.Dataset("short.nc") as file:
    print("h5netcdf writes two of three:", *file.variables["p1"][:])
END
diff - seen <<'END'
netCDF4 reads counts: 6.0 -- 6.25
h5netcdf.legacyapi reads counts: 6000 -32768 6250
netCDF4 writes two of three: 6.0 6.1 --
h5netcdf.legacyapi writes two of three: 6.0 6.1 --
h5netcdf writes two of three: 6.0 6.1 0.0
END
