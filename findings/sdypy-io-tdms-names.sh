#!/bin/sh
# sdypy-io-tdms 0.1.2: a channel with a slash in its name has half a name or none, and what is written has no start.
#
# `read_tdms` cuts the path of a channel at each "/": "v/slow [mm/s]" and "v/fast [mm/s]" both become "". A start at
# 12:00:00.750 is read as 12:00:00. `write_tdms` writes no start at all, and rounds to 24 bits: 600000.03 Pa to
# 600000.00, a count of 16777217 to 16777216. Nothing of it raises or warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile sdypy-io-tdms==0.1.2 npTDMS==1.13.0 numpy==2.3.5
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter
from sdypy_io_tdms import read_tdms
from sdypy_io_tdms.tdms import write_tdms

start = {"wf_start_time": np.datetime64("2026-11-30T12:00:00.750"), "wf_increment": 0.001}
with TdmsWriter("rig.tdms") as file:
    for name in ("p1", "v/slow [mm/s]", "v/fast [mm/s]"):
        file.write_segment([ChannelObject("rig", name, np.array([6.0, 6.25]), start)])
signals = read_tdms("rig.tdms")
for one in signals:
    print(f"read: {one['name']!r}, start {one['start_timestamp']}, {one['fs']:g} Hz")
written = {"group": "rig", "name": "x", "unit_str": "Pa", "fs": 1000, "data": np.array([600000.03, 2.0**24 + 1])}
write_tdms({**written, "start_timestamp": "2026-11-30 12:00:00.750"}, "copy.tdms")
channel = TdmsFile.read("copy.tdms")["rig"]["x"]
print("written:", *(f"{value:.2f}" for value in channel[:]), sorted(channel.properties))
END
diff - seen <<'END'
read: 'p1', start 2026-11-30T12:00:00, 1000 Hz
read: '', start 2026-11-30T12:00:00, 1000 Hz
read: '', start 2026-11-30T12:00:00, 1000 Hz
written: 600000.00 16777216.00 ['unit_string', 'wf_increment']
END
