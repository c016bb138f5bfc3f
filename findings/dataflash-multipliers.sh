#!/bin/sh
# pymavlink 2.4.50: of two fields of a DataFlash log in hundredths, one comes in bar, and the other 100 times larger.
#
# A log of ArduPilot has 650 twice: in a field of the type "c", whose hundredths are part of the type, and in one of the
# type "h" with the multiplier 0.01, which the log states in its messages FMTU and MULT beside the unit. `recv_match`
# gives 6.5 for the first and 650 for the second, and a stamp in us (multiplier 1e-6) as it stands. No key, attribute or
# warning tells the two apart, and exports of these messages have the same numbers. Read MULT and FMTU, and apply them to
# all types but c, C, e, E and L.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pymavlink==2.4.50
v/bin/python -W ignore - <<'END' | tee seen
import struct

from pymavlink import mavutil


def form(kind, name, types, columns, size):
    return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, 3 + size, name, types, columns)


def message(kind, types, *values):
    return b"\xa3\x95" + bytes([kind]) + struct.pack("<" + types, *values)


log = form(128, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns", 86)
log += form(130, b"PRES", b"Qch", b"TimeUS,A,B", 12)
log += form(132, b"MULT", b"Qbd", b"TimeUS,Id,Mult", 17)
log += form(133, b"FMTU", b"QBNN", b"TimeUS,FmtType,UnitIds,MultIds", 41)
for letter, factor in ((b"F", 1e-6), (b"B", 1e-2), (b"0", 1.0)):
    log += message(132, "Qbd", 1, letter[0], factor)
log += message(133, "QB16s16s", 1, 130, b"sPP", b"F0B")
for step in range(3):
    log += message(130, "Qhh", 1000 * step, 650, 650)
with open("a.bin", "wb") as file:
    file.write(log)
found = mavutil.mavlink_connection("a.bin").recv_match(type="PRES")
print("PRES:", found.to_dict())
END
diff - seen <<'END'
PRES: {'mavpackettype': 'PRES', 'TimeUS': 0, 'A': 6.5, 'B': 650}
END
