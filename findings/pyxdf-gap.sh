#!/bin/sh
# pyxdf 1.17.5: a loss of 4 s in a stream of 100 Hz vanishes, and every other sample gets a wrong time.
#
# A stream with a stamp at each sample, values equal to the stamps, and a hole. `load_xdf` replaces the stamps by a straight line,
# unless the hole is longer than 1 s and than 500 samples: both must hold, and the second is 5 s at 100 Hz. With 4 s lost, stamps are up
# to 2.2 s wrong, the hole is gone, and the rate is 74 Hz instead of 100. The stamps that were
# recorded are exact, and `dejitter_timestamps=False` returns them; so do smaller thresholds.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pyxdf==1.17.5 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import logging
import struct

import numpy as np
import pyxdf

logging.disable(logging.CRITICAL)


def chunk(tag, content):
    return b"\x04" + struct.pack("<IH", len(content) + 2, tag) + content


def recorded(times):
    """An XDF file of one stream whose samples are their own stamps."""
    info = "<info><name>p1</name><type>bar</type><channel_count>1</channel_count><nominal_srate>100</nominal_srate>"
    info += "<channel_format>double64</channel_format></info>"
    yield b"XDF:" + chunk(1, b"<info><version>1.0</version></info>")
    yield chunk(2, struct.pack("<I", 1) + info.encode())
    for part in np.array_split(times, len(times) // 100):
        yield chunk(3, struct.pack("<IBI", 1, 4, len(part)) + b"".join(struct.pack("<Bdd", 8, t, t) for t in part))
    yield chunk(6, struct.pack("<I", 1) + b"<info></info>")


for lost in (0.0, 0.4, 4.0, 6.0):
    times = 100 + np.arange(1800) * 0.01
    times = times[(times < 104) | (times >= 104 + lost)]
    with open("p1.xdf", "wb") as file:
        file.writelines(recorded(times))
    small = {"jitter_break_threshold_seconds": 0.1, "jitter_break_threshold_samples": 1}
    for what, keys in (("default", {}), ("not dejittered", {"dejitter_timestamps": False}), ("small thresholds", small)):
        (stream,), _ = pyxdf.load_xdf("p1.xdf", **keys)
        error = np.abs(stream["time_stamps"] - stream["time_series"][:, 0]).max()
        print(f"{lost} s lost, {what:16s}: stamps wrong by {error:.2f} s, {stream['info']['effective_srate']:.0f} Hz")
END
diff - seen <<'END'
0.0 s lost, default         : stamps wrong by 0.00 s, 100 Hz
0.0 s lost, not dejittered  : stamps wrong by 0.00 s, 100 Hz
0.0 s lost, small thresholds: stamps wrong by 0.00 s, 100 Hz
0.4 s lost, default         : stamps wrong by 0.21 s, 98 Hz
0.4 s lost, not dejittered  : stamps wrong by 0.00 s, 98 Hz
0.4 s lost, small thresholds: stamps wrong by 0.00 s, 100 Hz
4.0 s lost, default         : stamps wrong by 2.19 s, 74 Hz
4.0 s lost, not dejittered  : stamps wrong by 0.00 s, 78 Hz
4.0 s lost, small thresholds: stamps wrong by 0.00 s, 100 Hz
6.0 s lost, default         : stamps wrong by 0.00 s, 100 Hz
6.0 s lost, not dejittered  : stamps wrong by 0.00 s, 67 Hz
6.0 s lost, small thresholds: stamps wrong by 0.00 s, 100 Hz
END
