#!/bin/sh
# asammdf 8.8.28: one sample that the file itself marks invalid (-99 bar), read by six paths of one library.
#
# A channel holds 1, 2, -99, 4, 5 bar; an invalidation bit marks the third. get() leaves the sample out. select() and
# the exports to MATLAB and HDF5 give -99 as if measured. to_dataframe() and the export to CSV, which rests on it,
# put 3.0 there, interpolated, and nothing says so. resample() interpolates first and marks afterwards:
# it gives -48.5 at 0.15 s and calls it valid.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile asammdf==8.8.28 numpy==2.4.6 pandas==3.1.1 scipy==1.17.1 h5py==3.16.0
v/bin/python -W ignore - <<'END' | tee seen
import h5py
import numpy as np
import pandas as pd
from asammdf import MDF, Signal
from scipy.io import loadmat

stamps = np.arange(5) * 0.1
invalid = np.array([False, False, True, False, False])
file = MDF(version="4.10")
file.append([Signal(np.array([1.0, 2, -99, 4, 5]), stamps, unit="bar", name="p1", invalidation_bits=invalid)])
file.save("run.mf4")
file = MDF("run.mf4")


def show(path, values):
    print(f"{path:13s}", *(f"{value:g}" for value in values))


show("get", file.get("p1").samples)
show("select", file.select(["p1"])[0].samples)
show("to_dataframe", file.to_dataframe()["p1"])
for form in ("csv", "mat", "hdf5"):
    file.export(form, f"run.{form}")
show("csv", pd.read_csv("run.ChannelGroup_0_Python.csv")["p1"])
show("mat", loadmat("run.mat")["DG0_p1"][0])
show("hdf5", h5py.File("run.hdf")["ChannelGroup_0/p1"][:])
finer = file.resample(0.05).get("p1", ignore_invalidation_bits=True)
show("resample", finer.samples)
print("of it valid  ", *(f"{value:g}" for value in finer.samples[~finer.invalidation_bits]))
END
diff - seen <<'END'
get           1 2 4 5
select        1 2 -99 4 5
to_dataframe  1 2 3 4 5
csv           1 2 3 4 5
mat           1 2 -99 4 5
hdf5          1 2 -99 4 5
resample      1 1.5 2 -48.5 -99 -47.5 4 4.5 5
of it valid   1 1.5 2 -48.5 4 4.5 5
END
