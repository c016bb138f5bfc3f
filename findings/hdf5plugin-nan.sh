#!/bin/sh
# hdf5plugin 7.1.0: a missing reading (NaN) in a data set of SZ3 is -1.07e9 afterwards, of Zfp -2097152.
#
# A pressure in Pa, compressed to within 1 Pa: all is well but the missing reading, which is a number far below vacuum.
# It depends on the tolerance, so that no fill value can be named beforehand. An infinity keeps its place in SZ3; in
# Zfp it is -2, and the other three of its block of four, or beside a fill value of 1e36, are wrong by all of 6 bar. SZ
# (the older) keeps NaN, infinity and their neighbours. Nothing is said at writing or reading. Compress with Bitshuffle
# or SZ where readings may be missing.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile hdf5plugin==7.1.0 h5py==3.16.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import h5py
import hdf5plugin
import numpy as np

pressure = 6e5 + 1e3 * np.sin(np.arange(10_000) / 50)
packers = {
    "SZ3, 1 Pa": hdf5plugin.SZ3(absolute=1),
    "SZ3, 10 Pa": hdf5plugin.SZ3(absolute=10),
    "Zfp, 1 Pa": hdf5plugin.Zfp(accuracy=1),
    "Zfp, 100 Pa": hdf5plugin.Zfp(accuracy=100),
    "SZ, 1 Pa": hdf5plugin.SZ(absolute=1),
    "Bitshuffle": hdf5plugin.Bitshuffle(),
}
for name, packer in packers.items():
    for lost in (np.nan, np.inf, 1e36):
        written = pressure.copy()
        written[500] = lost
        with h5py.File("a.h5", "w") as file:
            file.create_dataset("p", data=written, chunks=(1000,), **packer)
        with h5py.File("a.h5") as file:
            found = file["p"][:]
        off = np.abs(found - pressure)
        off[500] = 0
        print(f"{name}: {lost:g} is {found[500]:g}, others off by up to {off.max():.6g} Pa")
END
diff - seen <<'END'
SZ3, 1 Pa: nan is -1.07314e+09, others off by up to 0.998958 Pa
SZ3, 1 Pa: inf is inf, others off by up to 0.998958 Pa
SZ3, 1 Pa: 1e+36 is 1e+36, others off by up to 0.998958 Pa
SZ3, 10 Pa: nan is -1.07368e+10, others off by up to 8.18632 Pa
SZ3, 10 Pa: inf is inf, others off by up to 8.18632 Pa
SZ3, 10 Pa: 1e+36 is 1e+36, others off by up to 8.18632 Pa
Zfp, 1 Pa: nan is -2.09715e+06, others off by up to 0.466812 Pa
Zfp, 1 Pa: inf is -2, others off by up to 599441 Pa
Zfp, 1 Pa: 1e+36 is 1e+36, others off by up to 599439 Pa
Zfp, 100 Pa: nan is 2.09715e+06, others off by up to 25.7878 Pa
Zfp, 100 Pa: inf is 0, others off by up to 599439 Pa
Zfp, 100 Pa: 1e+36 is 1e+36, others off by up to 599439 Pa
SZ, 1 Pa: nan is nan, others off by up to 0.999996 Pa
SZ, 1 Pa: inf is inf, others off by up to 0.999996 Pa
SZ, 1 Pa: 1e+36 is 1e+36, others off by up to 0.999996 Pa
Bitshuffle: nan is nan, others off by up to 0 Pa
Bitshuffle: inf is inf, others off by up to 0 Pa
Bitshuffle: 1e+36 is 1e+36, others off by up to 0 Pa
END
