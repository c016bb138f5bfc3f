#!/bin/sh
# SciPy 1.17.1: positions that MATLAB holds as doubles come as bytes, so that 200 mm plus 100 mm is 44 mm.
#
# A MAT file of MATLAB 5 may store a double array in the smallest whole number that holds it, and MATLAB does so.
# `loadmat` hands over the kind of the store, not of the array: uint8. Sums and differences wrap at 256: a move from 200
# to 100 to 50 mm has the steps 156 and 206, a velocity of the wrong sign, and 200 less 250 is 206. One reading with
# decimals in the array, and all is float64. Nothing warns. pymatreader does the same; mat4py gives Python's numbers.
# Pass `mat_dtype=True`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 numpy==2.4.6 pymatreader==1.3.2 mat4py==0.6.0
v/bin/python -W ignore - <<'END' | tee seen
import struct

import mat4py
import numpy as np
import pymatreader
from scipy.io import loadmat


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def write(path, store, data):
    """One column `x` of class double (6), stored as miUINT8 (2) or miDOUBLE (9)."""
    shape = struct.pack("<2i", 3, 1)
    parts = ((6, struct.pack("<II", 6, 0)), (5, shape), (1, b"x"), (store, data))
    head = b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + struct.pack("<H2s", 0x0100, b"IM")
    with open(path, "wb") as file:
        file.write(head + element(14, b"".join(element(*part) for part in parts)))


write("bytes.mat", 2, bytes([200, 100, 50]))
write("double.mat", 9, struct.pack("<3d", 200, 100, 50.5))
for path in ("bytes.mat", "double.mat"):
    for reader, x in (
        ("loadmat", loadmat(path)["x"].ravel()),
        ("loadmat, mat_dtype=True", loadmat(path, mat_dtype=True)["x"].ravel()),
        ("pymatreader", pymatreader.read_mat(path)["x"]),
        ("mat4py", np.ravel(mat4py.loadmat(path)["x"])),
    ):
        print(f"{path}, {reader}: {x.dtype}, {x[0]:g} + {x[1]:g} = {x[0] + x[1]:g}, steps", *np.diff(x), "| less 250:", (x - 250)[0])
END
diff - seen <<'END'
bytes.mat, loadmat: uint8, 200 + 100 = 44, steps 156 206 | less 250: 206
bytes.mat, loadmat, mat_dtype=True: float64, 200 + 100 = 300, steps -100.0 -50.0 | less 250: -50.0
bytes.mat, pymatreader: uint8, 200 + 100 = 44, steps 156 206 | less 250: 206
bytes.mat, mat4py: int64, 200 + 100 = 300, steps -100 -50 | less 250: -50
double.mat, loadmat: float64, 200 + 100 = 300, steps -100.0 -49.5 | less 250: -50.0
double.mat, loadmat, mat_dtype=True: float64, 200 + 100 = 300, steps -100.0 -49.5 | less 250: -50.0
double.mat, pymatreader: float64, 200 + 100 = 300, steps -100.0 -49.5 | less 250: -50.0
double.mat, mat4py: float64, 200 + 100 = 300, steps -100.0 -49.5 | less 250: -50.0
END
