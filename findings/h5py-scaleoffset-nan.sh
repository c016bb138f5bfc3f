#!/bin/sh
# h5py 3.16.0: with `scaleoffset`, a missing reading becomes the lowest number around it, once the file is closed.
#
# Pressures of about 6 bar with NaN where the sensor was off, stored with `scaleoffset=3`: three decimals, says its help, for
# floats. Read before the file is closed, NaN is there; read again from the file, it is the lowest value of its chunk, 5.767 bar here,
# and none is missing. For integers the number means bits instead of decimals: 17 and 300 in four bits are 1 and 12,
# without a warning. `scaleoffset=0` is right for integers.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile h5py==3.16.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import h5py
import numpy as np


def stored(values, **keys):
    with h5py.File("rig.h5", "w") as file:
        data = file.create_dataset("p1", data=values, chunks=(100 if len(values) > 100 else len(values),), **keys)
        yield data[...]
    with h5py.File("rig.h5") as file:
        yield file["p1"][...]


p1 = 6 + 0.1 * np.sin(np.arange(200) * 1.3)
p1[40] = 5.767
p1[[10, 150]] = np.nan
for when, values in zip(("before closing", "from the file"), stored(p1, scaleoffset=3), strict=True):
    missing = np.isnan(values).sum()
    print(f"{when}: missing {missing}, around the gap {values[9]:.3f} {values[10]:.3f} {values[11]:.3f}, lowest {np.nanmin(values[:100]):.3f}")
for bits in (4, 0):
    before, after = stored(np.array([1, 2, 17, 300]), scaleoffset=bits)
    print(f"integers, scaleoffset={bits}:", *before, "->", *after)
END
diff - seen <<'END'
before closing: missing 2, around the gap 5.924 nan 6.099, lowest 5.767
from the file: missing 0, around the gap 5.924 5.767 6.099, lowest 5.767
integers, scaleoffset=4: 1 2 17 300 -> 1 2 1 12
integers, scaleoffset=0: 1 2 17 300 -> 1 2 17 300
END
