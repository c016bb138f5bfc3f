#!/bin/sh
# python-can 4.6.1: a CSV or SQLite log of two buses has one bus, and what the rig sent reads as received.
#
# Two buses with a sensor of identifier 0x100 on each, a command sent, and a message of CAN FD. BLF, ASC and candump's
# log keep which bus a message came from and who sent it. CSV and SQLite (`.db`) keep neither, nor that a message was
# CAN FD: both sensors are one channel that jumps between two values, and no reader can tell them apart. TRC counts
# the buses from 1 and leaves out the message of CAN FD. Nothing of this raises.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile python-can==4.6.1
v/bin/python -W ignore - <<'END' | tee seen
import logging

import can

logging.disable(logging.CRITICAL)
start = 1764500000.0
frames = [(0, b"\1", False, True), (1, b"\2", False, True), (1, b"\3", False, False), (0, bytes(12), True, True)]
for ending in ("blf", "asc", "log", "csv", "db", "trc"):
    with can.Logger(f"bus.{ending}") as log:
        for number, (channel, data, fd, received) in enumerate(frames):
            stamp = start + 0.001 * number
            log(can.Message(stamp, 0x100, False, channel=channel, data=data, is_fd=fd, is_rx=received))
    with can.LogReader(f"bus.{ending}") as read:
        kept = [(one.channel, "received" if one.is_rx else "sent", "FD" if one.is_fd else "classic") for one in read]
    print(f"{ending}:", *(" ".join(map(str, one)) for one in kept), sep=" | ")
END
diff - seen <<'END'
blf: | 0 received classic | 1 received classic | 1 sent classic | 0 received FD
asc: | 0 received classic | 1 received classic | 1 sent classic | 0 received FD
log: | can0 received classic | can1 received classic | can1 sent classic | can0 received FD
csv: | None received classic | None received classic | None received classic | None received classic
db: | None received classic | None received classic | None received classic | None received classic
trc: | 1 received classic | 2 received classic | 2 sent classic
END
