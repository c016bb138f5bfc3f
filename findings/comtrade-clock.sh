#!/bin/sh
# comtrade 0.2.0: stamps of an hour at 10 kHz repeat, a channel's skew is not applied, and stamps in the data are passed over.
#
# A COMTRADE recording of 10 kHz. `time` has 32 bits: from 1024 s on neighbouring samples share stamps; in the last six minutes six of ten do.
# A second channel that the header says was read 50 us after the first (its skew) has the same stamps as the first; the number stands in
# `cfg.analog_channels`. The data file has a stamp in each row: where they disagree with the rate of the header,
# the rate wins, in silence. Missing readings (99999, 8000 hex) are NaN, which is right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile comtrade==0.2.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import comtrade
import numpy as np


def recording(rate, count, data, kind="ASCII", skew=0):
    channels = f"1,p1,,,bar,0.01,0,0,-32767,32767,1,1,S\n2,p2,,,bar,0.01,0,{skew},-32767,32767,1,1,S\n"
    start = "29/11/2026,12:00:00.000000\n" * 2
    read = comtrade.Comtrade()
    read.read(f"rig,logger,1999\n2,2A,0D\n{channels}50\n1\n{rate},{count}\n{start}{kind}\n1\n", data)
    return read


rows = "1,0,600,600\n2,100,601,601\n3,900,99999,602\n4,1000,603,603\n"
read = recording(10_000, 4, rows, skew=50)
print("stamps in the data 0 0.1 0.9 1.0 ms, read as", *(f"{t * 1e3:.1f}" for t in read.time), "ms")
print("p1", *(f"{p:.2f}" for p in read.analog[0]), "| skew of p2", f"{read.cfg.analog_channels[1].skew:g} us, stamps of its own: none")
count = 36_000_000 // 10
packed = np.zeros(count, [("number", "<i4"), ("stamp", "<i4"), ("p1", "<i2"), ("p2", "<i2")])
packed["number"] = np.arange(count) + 1 + 9 * count
read = recording(10_000, count, packed.tobytes(), "BINARY")
stamps = np.asarray(read.time)
print(f"the last 6 min of 1 h: {stamps.dtype}, {np.mean(np.diff(stamps) == 0):.0%} of the stamps repeat the one before")
END
diff - seen <<'END'
stamps in the data 0 0.1 0.9 1.0 ms, read as 0.0 0.1 0.2 0.3 ms
p1 6.00 6.01 nan 6.03 | skew of p2 50 us, stamps of its own: none
the last 6 min of 1 h: float32, 59% of the stamps repeat the one before
END
