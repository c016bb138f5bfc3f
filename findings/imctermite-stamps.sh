#!/bin/sh
# imctermite 2.1.18: recordings of imc at 4 kHz come out with stamps in steps of 0.2 and 0.3 ms, and start at a whole second.
#
# A channel of an imc recorder, one sample each 0.25 ms from 0.5 s on, started at 12:00:00.25. `get_channels` rounds `xdata` to
# four decimals, the power of ten below the step: 0.5002, 0.5005, 0.5008. At 3 kHz the steps are 0.3 and 0.4 ms. At
# 1, 2 and 5 kHz they are right. The time of the start is cut to a whole second, so that files of two recorders cannot be laid on
# one clock, though they hold the fraction. Factor and offset of the counts are applied, which is right; `xstepwidth` keeps six digits.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile imctermite==2.1.18
v/bin/python -W ignore - <<'END' | tee seen
import struct

import imctermite


def key(name, *fields, version=1):
    body = ",".join(str(field) for field in fields)
    return f"|{name},{version},{len(body)},{body};".encode()


def recorded(step, counts):
    """A file of imc with one channel of 16 bits, 0.01 bar a bit."""
    data = struct.pack(f"<{len(counts)}h", *counts)
    yield b"|CF,2,1,1;|CK,1,3,1,1;"
    yield key("CG", 1, 1, 1)
    yield key("CD", f"{step:.16E}", 1, 1, "s", 0, 0, 0, f"{0.5:.16E}", 1, version=2)
    yield key("NT", 29, 11, 2026, 12, 0, 0.25)
    yield key("CC", 1, 1)
    yield key("CP", 1, 2, 4, 16, 0, 0, 1, 0)
    yield key("CR", 1, f"{0.01:.16E}", f"{0:.16E}", 1, 3, "bar")
    yield key("CN", 0, 0, 0, 2, "p1", 0, "")
    yield key("Cb", 1, 0, 1, 1, 0, len(data), 0, len(data), 1, f"{0.5:.16E}", f"{0:.16E}")
    yield f"|CS,1,{len(data) + 11:10d},{1:10d},".encode() + data + b";"


for rate in (1000, 2000, 3000, 4000, 5000, 12_800):
    with open("rig.raw", "wb") as file:
        file.writelines(recorded(1 / rate, [600, 610, 620, 630, 640]))
    (channel,) = imctermite.imctermite(b"rig.raw").get_channels(True)
    print(f"{rate} Hz:", *(f"{t:g}" for t in channel["xdata"]), "s |", *(f"{p:g}" for p in channel["ydata"]), channel["yunit"])
print("started at 12:00:00.25, read as", channel["trigger-time"])
END
diff - seen <<'END'
1000 Hz: 0.5 0.501 0.502 0.503 0.504 s | 6 6.1 6.2 6.3 6.4 bar
2000 Hz: 0.5 0.5005 0.501 0.5015 0.502 s | 6 6.1 6.2 6.3 6.4 bar
3000 Hz: 0.5 0.5003 0.5007 0.501 0.5013 s | 6 6.1 6.2 6.3 6.4 bar
4000 Hz: 0.5 0.5002 0.5005 0.5008 0.501 s | 6 6.1 6.2 6.3 6.4 bar
5000 Hz: 0.5 0.5002 0.5004 0.5006 0.5008 s | 6 6.1 6.2 6.3 6.4 bar
12800 Hz: 0.5 0.50008 0.50016 0.50023 0.50031 s | 6 6.1 6.2 6.3 6.4 bar
started at 12:00:00.25, read as 2026-11-29T12:00:00
END
