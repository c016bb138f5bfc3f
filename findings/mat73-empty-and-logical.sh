#!/bin/sh
# mat73 0.65 and pymatreader 1.3.2: empty and logical arrays of a MATLAB v7.3 file; what HDF5 itself has of them.
#
# MATLAB stores an empty array as its size: the dataset of zeros(0, 7) is the two numbers 0 and 7, and only the attribute
# MATLAB_empty tells. mat73 gives None for it, pymatreader an empty array, h5py the two numbers. A logical array is bool
# by mat73 and uint8 by pymatreader, so that ~ or a choice by it, x[mask], takes the samples 0 and 1 instead of the true ones.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile mat73==0.65 pymatreader==1.3.2 h5py==3.16.0 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import h5py
import mat73
import numpy as np
import pymatreader

variables = {
    "none": (np.array([0, 7], "u8"), b"double", {"MATLAB_empty": np.uint8(1)}),
    "on": (np.array([[1], [0], [1]], "u1"), b"logical", {"MATLAB_int_decode": np.int32(1)}),
}
with h5py.File("a.mat", "w", userblock_size=512) as file:
    for name, (values, kind, attributes) in variables.items():
        file[name] = values
        file[name].attrs["MATLAB_class"] = np.bytes_(kind)
        file[name].attrs.update(attributes)
with open("a.mat", "r+b") as file:
    file.write(b"MATLAB 7.3 MAT-file, HDF5 schema 1.00 .".ljust(124) + bytes([0, 2]) + b"IM")
x = np.array([10.0, 20.0, 30.0])
readers = {"mat73": mat73.loadmat, "pymatreader": pymatreader.read_mat, "h5py": lambda path: h5py.File(path)}
for name, read in readers.items():
    found = read("a.mat")
    none, on = found["none"], np.ravel(found["on"])
    print(f"{name}: none {none[()] if name == 'h5py' else none!r}, on {on.dtype}, x[on] {x[on]}")
END
diff - seen <<'END'
mat73: none None, on bool, x[on] [10. 30.]
pymatreader: none array([], dtype=float64), on uint8, x[on] [20. 10. 20.]
h5py: none array([0, 7], dtype=uint64), on uint8, x[on] [20. 10. 20.]
END
