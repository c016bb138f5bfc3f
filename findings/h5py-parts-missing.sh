#!/bin/sh
# h5py 3.16.0: a recording made of parts reads 0 Pa where a part was not copied with it, and no call says so.
#
# Three files of 100 readings at 6 bar, joined by a virtual dataset, as recorders join what they wrote by the minute. The
# file that joins is copied with two of the three: the middle third is 0, by slice, by iteration and by `mean`, 4 bar on
# average. The dataset's own size, dtype and fill value are as before. A dataset whose numbers lie in an external raw file
# reads 0 too beyond the end of one that was cut short; where that file is missing altogether, it raises. HDF5 calls it
# the fill value; a fill value of NaN at the time of joining shows the gap. Ask `virtual_sources()` for its files, and
# whether they are there, before the numbers.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile h5py==3.16.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import os

import h5py
import numpy as np

layouts = {name: h5py.VirtualLayout(shape=(300,), dtype="f8") for name in ("p", "p_nan")}
for part in range(3):
    with h5py.File(f"part{part}.h5", "w") as file:
        file["p"] = np.full(100, 6e5)
    for layout in layouts.values():
        layout[100 * part : 100 * part + 100] = h5py.VirtualSource(f"part{part}.h5", "p", shape=(100,))
with h5py.File("all.h5", "w") as file:
    file.create_virtual_dataset("p", layouts["p"])
    file.create_virtual_dataset("p_nan", layouts["p_nan"], fillvalue=np.nan)
    file.create_dataset("outside", (300,), "f8", external=[("raw.bin", 0, h5py.h5f.UNLIMITED)])[:] = 6e5
os.remove("part1.h5")
os.truncate("raw.bin", 1600)
with h5py.File("all.h5") as file:
    for name in ("p", "p_nan", "outside"):
        p = file[name]
        places = ", ".join(f"at {row} {p[row]:.0f}" for row in (99, 100, 200))
        print(f"{name:8s} {p.shape} {p.dtype}: {places} Pa, mean {np.mean(p):.0f} Pa")
    sources = [one.file_name for one in file["p"].virtual_sources()]
    print("missing:", *(name for name in sources if not os.path.exists(name)))
os.remove("raw.bin")
with h5py.File("all.h5") as file:
    try:
        print(file["outside"][0])
    except OSError as error:
        print("outside, without its file:", type(error).__name__)
END
diff - seen <<'END'
p        (300,) float64: at 99 600000, at 100 0, at 200 600000 Pa, mean 400000 Pa
p_nan    (300,) float64: at 99 600000, at 100 nan, at 200 600000 Pa, mean nan Pa
outside  (300,) float64: at 99 600000, at 100 600000, at 200 0 Pa, mean 400000 Pa
missing: part1.h5
outside, without its file: OSError
END
