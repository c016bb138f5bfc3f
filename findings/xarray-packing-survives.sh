#!/bin/sh
# xarray 2026.9.0 with netCDF4 1.7.5.1: after which operations a variable is still packed with the factor it was read with.
#
# A pressure of 1 to 3 bar is packed in int16 with 0.001. Changed to kPa in place (p.values[:], p[:] or p.data) it is packed
# with 0.001 again when written: 100, 200 and 300 do not fit, and the file has other numbers, without a warning. isel(),
# copy(data=...) and assignment to .data keep the packing; arithmetic, where(), clip() and fillna() drop it.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile xarray==2026.9.0 netCDF4==1.7.5.1.post1 numpy==2.4.6 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import xarray as xr

packing = {"dtype": "int16", "scale_factor": 0.001, "_FillValue": np.int16(-32768)}
packed = xr.Dataset({"p": ("t", [1.0, 2.0, 3.0], {"units": "bar"})})
packed["p"].encoding = packing
packed.to_netcdf("bar.nc")


def read():
    return xr.open_dataset("bar.nc").load()["p"]


def replaced(p):
    p.data = p.data * 1
    return p


operations = {
    "p * 1": lambda p: p * 1,
    "where": lambda p: p.where(p > 0),
    "clip": lambda p: p.clip(0, 9),
    "fillna": lambda p: p.fillna(0),
    "isel": lambda p: p.isel(t=slice(0, 2)),
    "copy": lambda p: p.copy(data=p.data * 1),
    ".data =": replaced,
}
for name, operation in operations.items():
    print(f"{name:8s}", "packed" if "scale_factor" in operation(read()).encoding else "not packed")
p = read()
p.values[:] *= 100
p.attrs["units"] = "kPa"
p.to_dataset().to_netcdf("kpa.nc")
print("in place", *(f"{value:g}" for value in xr.open_dataset("kpa.nc")["p"].values), "kPa")
END
diff - seen <<'END'
p * 1    not packed
where    not packed
clip     not packed
fillna   not packed
isel     packed
copy     packed
.data =  packed
in place -31.072 3.392 -27.68 kPa
END
