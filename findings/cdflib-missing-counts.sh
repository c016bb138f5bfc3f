#!/bin/sh
# cdflib 1.3.16: `fillval_to_nan` makes missing floats NaN; a missing count of 16 bits stays -32768.
#
# A CDF file with a pressure as floats and as counts, each with the FILLVAL that ISTP asks for. `cdf_to_xarray` with
# `fillval_to_nan=True` marks the float alone: the counts keep -32768, as integers have no NaN, and neither the
# attribute nor a word tells. What follows scales it to a reading below vacuum. `varget` marks neither. A time in
# CDF_EPOCH with a fraction of a millisecond is cut by `to_datetime`, without rounding: at 2 kHz each second sample has
# the stamp of the one before. Convert counts to floats and mark FILLVAL yourself; write CDF_TIME_TT2000.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile cdflib==1.3.16 xarray==2026.9.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from cdflib import CDF, cdfepoch
from cdflib.cdfwrite import CDF as Writer
from cdflib.xarray import cdf_to_xarray

start = cdfepoch.compute_epoch([2026, 1, 1, 0, 0, 0, 0])
columns = {
    "Epoch": (31, start + np.arange(5) * 0.5, -1e31),
    "pressure": (44, np.array([6.0, -1e31, 6.2, 6.3, 6.4], "f4"), np.float32(-1e31)),
    "counts": (2, np.array([6000, -32768, 6200, 6300, 6400], "i2"), np.int16(-32768)),
}
writer = Writer("log.cdf", delete=True)
for name, (kind, values, fill) in columns.items():
    about = {"Variable": name, "Data_Type": kind, "Num_Elements": 1, "Rec_Vary": True, "Dim_Sizes": []}
    link = {} if name == "Epoch" else {"DEPEND_0": "Epoch"}
    writer.write_var(about, var_attrs={"FILLVAL": fill} | link, var_data=values)
writer.close()
table = cdf_to_xarray("log.cdf", fillval_to_nan=True)
for name in ("pressure", "counts"):
    print(f"{name}: {table[name].values.tolist()}, mean {float(table[name].mean()):.6g}")
print("varget:", CDF("log.cdf").varget("counts").tolist())
stamps = cdfepoch.to_datetime(columns["Epoch"][1]) - np.datetime64("2026-01-01")
print("stamps in ms:", (stamps / np.timedelta64(1, "ms")).tolist())
END
diff - seen <<'END'
pressure: [6.0, nan, 6.199999809265137, 6.300000190734863, 6.400000095367432], mean 6.225
counts: [6000, -32768, 6200, 6300, 6400], mean -1573.6
varget: [6000, -32768, 6200, 6300, 6400]
stamps in ms: [0.0, 0.0, 1.0, 1.0, 2.0]
END
