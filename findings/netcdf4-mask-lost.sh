#!/bin/sh
# netCDF4 1.7.5.1, then SciPy 1.17.1, h5py 3.16.0, NumPy 2.4.6 and pandas 3.1.1: where a missing sample becomes a number.
#
# A packed pressure (0.01 bar, fill value -32768) has one missing sample. netCDF4 masks it; below the mask stands the fill
# value, not scaled: -32768 bar beside 1 and 3. savemat, h5py, savetxt, np.interp and np.fft take it as measured; pandas and
# xarray make it NaN. A valid_range masks samples beyond it likewise, which xarray shows as they are.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile netCDF4==1.7.5.1.post1 scipy==1.17.1 h5py==3.16.0 pandas==3.1.1 xarray==2026.9.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import h5py
import netCDF4
import numpy as np
import pandas as pd
import xarray as xr
from scipy.io import loadmat, savemat

with netCDF4.Dataset("a.nc", "w") as file:
    file.createDimension("t", 3)
    for name, attributes in (("p", {}), ("q", {"valid_range": np.array([0, 250], "i2")})):
        variable = file.createVariable(name, "i2", ("t",), fill_value=np.int16(-32768))
        variable.setncatts({"scale_factor": 0.01, "units": "bar", **attributes})
        variable[:] = np.ma.array([1.0, 2.0, 3.0], mask=[False, name == "p", False])
    p, q = file["p"][:], file["q"][:]
savemat("a.mat", {"p": p})
with h5py.File("a.h5", "w") as file:
    file["p"] = p
    stored = file["p"][:]
np.savetxt("a.txt", p)
print("netCDF4", p, q)
print("savemat", loadmat("a.mat")["p"].ravel())
print("h5py", stored)
print("savetxt", np.loadtxt("a.txt"))
print("interp at 0.5", np.interp(0.5, [0, 1, 2], p))
print("pandas", pd.Series(p).to_numpy())
print("xarray", xr.open_dataset("a.nc")["p"].values, xr.open_dataset("a.nc")["q"].values)
END
diff - seen <<'END'
netCDF4 [1.0 -- 3.0] [1.0 2.0 --]
savemat [ 1.0000e+00 -3.2768e+04  3.0000e+00]
h5py [ 1.0000e+00 -3.2768e+04  3.0000e+00]
savetxt [ 1.0000e+00 -3.2768e+04  3.0000e+00]
interp at 0.5 -16383.5
pandas [ 1. nan  3.]
xarray [ 1. nan  3.] [1. 2. 3.]
END
