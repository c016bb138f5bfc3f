#!/bin/sh
# pyuff 2.5.8: missing readings become 0 in the file and in the caller's set, and a binary set that overwrites is lost.
#
# A recording with NaN where the sensor was off. `write_sets` writes a pressure of 0 for it, infinity as 1.8e308, and the set
# that was handed over now holds these numbers too. With `mode="overwrite"` a binary set 58 leaves a file of seven characters without data,
# as the part before the numbers is written, then removed with the rest; `mode="add"` into a new file is right. Stamps with
# jitter or a hole are replaced by even ones where `abscissa_spacing` is 1; with 0 they are kept. No error or warning in any of these.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pyuff==2.5.8 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import os

import numpy as np
import pyuff


def recording(data, times, **keys):
    point = {"rsp_node": 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1, "rsp_ent_name": "p1", "ref_ent_name": ""}
    kinds = {"abscissa_spec_data_type": 17, "ordinate_spec_data_type": 15, "orddenom_spec_data_type": 0}
    return {"type": 58, "func_type": 1, "id1": "p1", "data": data, "x": times, **point, **kinds, **keys}


def back(path):
    found = pyuff.UFF(path).read_sets()
    return found if isinstance(found, dict) else {"data": [], "x": []}


even = np.array([0.0, 1.0, 2.0, 3.0])
p1 = np.array([6.0, np.nan, 6.2, np.inf])
pyuff.UFF("text.uff").write_sets(recording(p1.copy(), even, abscissa_spacing=1), mode="overwrite")
print("6, NaN, 6.2, infinity written and read:", *(f"{value:.3g}" for value in back("text.uff")["data"]))
handed = recording(p1.copy(), even, abscissa_spacing=1)
pyuff.UFF("text.uff").write_sets(handed, mode="overwrite")
print("the set handed over, afterwards:", *(f"{value:.3g}" for value in handed["data"]))
for mode in ("overwrite", "add"):
    path = f"{mode}.uff"
    pyuff.UFF(path).write_sets(recording(even.copy(), even, binary=1, abscissa_spacing=1), mode=mode)
    print(f"binary, {mode}: {len(back(path)['data'])} of 4 samples, more than 7 bytes: {os.path.getsize(path) > 7}")
for spacing in (1, 0):
    hole = np.array([0.0, 1.0, 5.0, 6.0])
    pyuff.UFF("text.uff").write_sets(recording(even.copy(), hole, abscissa_spacing=spacing), mode="overwrite")
    print(f"stamps 0 1 5 6, abscissa_spacing {spacing}:", *(f"{x:g}" for x in back("text.uff")["x"]))
END
diff - seen <<'END'
6, NaN, 6.2, infinity written and read: 6 0 6.2 1.8e+308
the set handed over, afterwards: 6 0 6.2 1.8e+308
binary, overwrite: 0 of 4 samples, more than 7 bytes: False
binary, add: 4 of 4 samples, more than 7 bytes: True
stamps 0 1 5 6, abscissa_spacing 1: 0 1 2 3
stamps 0 1 5 6, abscissa_spacing 0: 0 1 5 6
END
