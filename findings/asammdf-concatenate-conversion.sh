#!/bin/sh
# asammdf 8.8.28: MDF.concatenate takes conversion and unit of the first file for all files.
#
# Two runs store p1 as 1000 counts. Their files scale it by 0.001 bar and by 0.002 bar, as after a change of the
# sensor: 1 bar and 2 bar. Joined, all ten samples are 1 bar. Two runs that state bar and kPa are joined to one channel
# in bar, of 1 to 500. Neither raises or warns; stack() keeps the two runs apart and right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile asammdf==8.8.28 numpy==2.4.6 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from asammdf import MDF, Signal

stamps = np.arange(3) * 0.1


def write(path, values, unit, factor=None):
    conversion = None if factor is None else {"a": factor, "b": 0.0}
    file = MDF(version="4.10")
    file.append([Signal(np.asarray(values), stamps, unit=unit, name="p1", conversion=conversion)])
    file.save(path)


def show(what, signal):
    print(f"{what:19s}", *(f"{value:g}" for value in signal.samples), signal.unit)


counts = np.array([1000, 1000, 1000], "int16")
write("run1.mf4", counts, "bar", 0.001)
write("run2.mf4", counts, "bar", 0.002)
write("run3.mf4", [1.0, 2.0, 3.0], "bar")
write("run4.mf4", [100.0, 200.0, 300.0], "kPa")
show("first alone", MDF("run1.mf4").get("p1"))
show("second alone", MDF("run2.mf4").get("p1"))
show("concatenated", MDF.concatenate(["run1.mf4", "run2.mf4"]).get("p1"))
show("bar and kPa", MDF.concatenate(["run3.mf4", "run4.mf4"]).get("p1"))
stacked = MDF.stack(["run1.mf4", "run2.mf4"])
for group, index in stacked.channels_db["p1"]:
    show(f"stacked, group {group}", stacked.get("p1", group=group, index=index))
END
diff - seen <<'END'
first alone         1 1 1 bar
second alone        2 2 2 bar
concatenated        1 1 1 1 1 1 bar
bar and kPa         1 2 3 100 200 300 bar
stacked, group 0    1 1 1 bar
stacked, group 1    2 2 2 bar
END
