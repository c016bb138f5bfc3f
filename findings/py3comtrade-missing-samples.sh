#!/bin/sh
# py3comtrade 4.2.4: a reading that the recorder marked as missing is -32.768 bar, and bar is no unit.
#
# COMTRADE marks a missing sample by 8000 hex in a binary file and by 99999 in a text. py3comtrade scales the mark with
# the rest: with a step of 0.001 and an offset of 1 bar it is -31.768 bar, a vacuum that cannot be; in the text 100.999
# bar. The package comtrade gives NaN. A unit that is not electrical, as bar or mm, is dropped for "none"; the skew of
# 500 us of a channel is read, and not applied. Nothing warns. Mark what lies at the edge of the range as missing, or
# take comtrade.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile py3comtrade==4.2.4 comtrade==0.2.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import logging
import struct
from pathlib import Path

import comtrade
from py3comtrade.reader.comtrade_reader import comtrade_reader

logging.disable(logging.CRITICAL)
axis = """rig,1,1999
2,2A,0D
1,p1,,,bar,0.001,0,0,-32767,32767,1,1,P
2,p2,,,V,0.001,1,500,-32767,32767,1,1,P
50
1
1000,3
02/01/2026,03:04:05.000000
02/01/2026,03:04:05.000000
{kind}
1
"""
counts = [(6250, 100), (-32768, -32768), (6400, 300)]
for kind, mark in (("BINARY", -32768), ("ASCII", 99999)):
    Path(f"{kind}.cfg").write_text(axis.format(kind=kind))
    rows = [[mark if count == -32768 else count for count in row] for row in counts]
    binary = b"".join(struct.pack("<IIhh", place + 1, 1000 * place, *row) for place, row in enumerate(counts))
    text = "".join(f"{place + 1},{1000 * place},{row[0]},{row[1]}\n" for place, row in enumerate(rows))
    Path(f"{kind}.dat").write_bytes(binary if kind == "BINARY" else text.encode())
    found = comtrade_reader(f"{kind}.cfg")
    for channel in found.analogs:
        print(f"{kind}, py3comtrade, {channel.name}:", *channel.values, f"unit {channel.unit.value!r}, skew {channel.skew}")
    whole = comtrade.load(f"{kind}.cfg", f"{kind}.dat")
    for name, values, channel in zip(whole.analog_channel_ids, whole.analog, whole.cfg.analog_channels):
        print(f"{kind}, comtrade, {name}:", *(round(float(value), 3) for value in values), f"unit {channel.uu!r}")
END
diff - seen <<'END'
BINARY, py3comtrade, p1: 6.25 -32.768 6.4 unit '', skew 0.0
BINARY, py3comtrade, p2: 1.1 -31.768 1.3 unit 'V', skew 500.0
BINARY, comtrade, p1: 6.25 nan 6.4 unit 'bar'
BINARY, comtrade, p2: 1.1 nan 1.3 unit 'V'
ASCII, py3comtrade, p1: 6.25 99.999 6.4 unit '', skew 0.0
ASCII, py3comtrade, p2: 1.1 100.999 1.3 unit 'V', skew 500.0
ASCII, comtrade, p1: 6.25 nan 6.4 unit 'bar'
ASCII, comtrade, p2: 1.1 nan 1.3 unit 'V'
END
