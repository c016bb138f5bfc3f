#!/bin/sh
# mdfreader 4.3: a CSV export has columns under the wrong names, where a channel follows one of texts.
#
# An MDF4 file with p1, a state in words ("shut", "open"), p2 and p3. `export_to_csv` resamples; the channel behind the state keeps
# its old samples, is then too long and gets no column, but its name is in the header all the same. So p3 stands under the name
# of p2, and the last name has no column. The state itself is left out. The last sample is lost; a slow channel is
# held before its first sample. Invalid samples are numbers, 9 bar here, in the CSV as in `get_channel_data`. asammdf 8.8.28
# wrote the file and reads it right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile mdfreader==4.3 asammdf==8.8.28 numpy==2.4.6 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import logging
import pathlib

import mdfreader
import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.conversion_utils import from_dict

logging.disable(logging.CRITICAL)
stamps = np.arange(5) * 0.1
words = from_dict({"val_0": 0, "text_0": "shut", "val_1": 1, "text_1": "open"})
invalid = np.array([False, False, True, False, False])
signals = [
    Signal(np.array([1.0, 1.1, 9.0, 1.3, 1.4]), stamps, name="p1", unit="bar", invalidation_bits=invalid),
    Signal(np.array([0, 0, 1, 1, 1], "uint8"), stamps, name="state", conversion=words),
    Signal(np.array([2.0, 2.1, 2.2, 2.3, 2.4]), stamps, name="p2", unit="bar"),
    Signal(np.array([3.0, 3.1, 3.2, 3.3, 3.4]), stamps, name="p3", unit="bar"),
]
file = MDF(version="4.10")
file.append(signals, common_timebase=True)
file.append([Signal(np.array([10.0, 20.0]), np.array([0.15, 0.35]), name="T", unit="degC")])
file.save("rig.mf4")
read = mdfreader.Mdf("rig.mf4")
for name in ("p1", "p2", "p3"):
    print(name, "mdfreader", *read.get_channel_data(name).tolist(), "| asammdf", *MDF("rig.mf4").get(name).samples.tolist())
read.export_to_csv("rig.csv", sampling=0.1)
names, units, *rows = pathlib.Path("rig.csv").read_text().splitlines()
print(names, units, sep="\n")
for row in rows:
    print(",".join(f"{float(value):.1f}" for value in row.split(",")))
END
diff - seen <<'END'
p1 mdfreader 1.0 1.1 9.0 1.3 1.4 | asammdf 1.0 1.1 1.3 1.4
p2 mdfreader 2.0 2.1 2.2 2.3 2.4 | asammdf 2.0 2.1 2.2 2.3 2.4
p3 mdfreader 3.0 3.1 3.2 3.3 3.4 | asammdf 3.0 3.1 3.2 3.3 3.4
time,p1,p2,p3,T
s,bar,bar,bar,degC
0.0,1.0,3.0,10.0
0.1,1.1,3.1,10.0
0.2,9.0,3.2,12.5
0.3,1.3,3.3,17.5
END
