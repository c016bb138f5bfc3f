#!/bin/sh
# python-can 4.6.1: a CAN log of Vector's tools with relative time stamps is read with all messages at one time.
#
# The header of an ASC file says whether its stamps count from the start or from the message before (`timestamps relative`, a choice in
# CANalyzer). python-can skips the word: ten messages 10 ms apart all stand at 0.010 s. A log with absolute stamps
# is right. Both begin at 0 unless `relative_timestamp=False` is given, while TRC, BLF and candump logs of the same
# messages begin in 2026: merged with one of these, an ASC log is 56 years early.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile python-can==4.6.1
v/bin/python -W ignore - <<'END' | tee seen
import pathlib
import time

import can

BEGIN = "Sun Nov 29 12:00:00.000 pm 2026"


def asc(kind, stamps):
    rows = "".join(f"   {stamp:.6f} 1  100             Rx   d 1 0A\n" for stamp in stamps)
    pathlib.Path("rig.asc").write_text(
        f"date {BEGIN}\nbase hex  timestamps {kind}\ninternal events logged\nBegin Triggerblock {BEGIN}\n"
        f"   0.000000 Start of measurement\n{rows}End TriggerBlock\n"
    )
    return [message.timestamp for message in can.ASCReader("rig.asc")]


print("absolute:", *(f"{stamp:.3f}" for stamp in asc("absolute", [0.01 * row for row in range(1, 6)])))
print("relative:", *(f"{stamp:.3f}" for stamp in asc("relative", [0.01] * 5)))
for kind in ("asc", "trc", "blf", "log", "csv"):
    with can.Logger(f"log.{kind}") as log:
        log(can.Message(timestamp=1795953600.5, arbitration_id=0x100, data=[1], is_extended_id=False))
    (read,) = can.LogReader(f"log.{kind}")
    print(f"one message of 2026 through {kind}: read as of {time.gmtime(read.timestamp).tm_year}")
END
diff - seen <<'END'
absolute: 0.010 0.020 0.030 0.040 0.050
relative: 0.010 0.010 0.010 0.010 0.010
one message of 2026 through asc: read as of 1970
one message of 2026 through trc: read as of 2026
one message of 2026 through blf: read as of 2026
one message of 2026 through log: read as of 2026
one message of 2026 through csv: read as of 2026
END
