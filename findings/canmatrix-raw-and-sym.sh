#!/bin/sh
# canmatrix 1.3.3, cantools 45.1.0: one DBC, and `encode` means raw values in one and physical ones in the other.
#
# A supply of 6.5 bar (0.1 bar a bit) encoded by canmatrix is the raw value 6, decoded as 0.6 bar by itself and by cantools;
# a negative pressure in an unsigned signal is a huge one. cantools encodes what decodes to 6.5 bar, and raises where it does not
# fit. Saved as SYM by canmatrix, a force that is a 32-bit float has become a signed integer, since a float is marked as
# signed too: 13.5 N read 2.2e9 N. Saved as JSON or DBC it is right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile canmatrix==1.3.3 cantools==45.1.0
v/bin/python -W ignore - <<'END' | tee seen
import io
import struct

import canmatrix.formats
import cantools

DBC = """VERSION ""
NS_ :
BS_:
BU_: PLC
BO_ 256 Rig: 8 PLC
 SG_ p1 : 0|16@1+ (0.1,0) [0|0] "bar" PLC
 SG_ x : 16|16@1- (0.01,-5) [-100|100] "mm" PLC
 SG_ F : 32|32@1- (2,1) [0|0] "N" PLC
SIG_VALTYPE_ 256 F : 1;
"""
theirs = cantools.database.load_string(DBC, "dbc").get_message_by_name("Rig")
matrix = canmatrix.formats.load_flat(io.BytesIO(DBC.encode()), "dbc")
raw = struct.pack("<Hhf", 65, -1200, 6.25)


def decoded(matrix, raw):
    return {name: f"{float(signal.phys_value):g}" for name, signal in matrix.frame_by_name("Rig").decode(raw).items()}


for p1 in (6.5, -1.0):
    values = {"p1": p1, "x": 0.0, "F": 1.0}
    sent = bytes(matrix.frame_by_name("Rig").encode(values))
    print("canmatrix encodes", values, "as", theirs.decode(sent))
    try:
        print("cantools encodes ", values, "as", theirs.decode(theirs.encode(values)))
    except OverflowError:
        print("cantools raises")
print("cantools decodes ", {name: f"{value:g}" for name, value in theirs.decode(raw).items()})
print("canmatrix decodes", decoded(matrix, raw))
for kind in ("dbc", "json", "sym"):
    file = io.BytesIO()
    canmatrix.formats.dump(matrix, file, kind)
    print("saved as", f"{kind:4s}", "  ", decoded(canmatrix.formats.load_flat(io.BytesIO(file.getvalue()), kind), raw))
END
diff - seen <<'END'
canmatrix encodes {'p1': 6.5, 'x': 0.0, 'F': 1.0} as {'p1': 0.6000000000000001, 'x': -5.0, 'F': 3.0}
cantools encodes  {'p1': 6.5, 'x': 0.0, 'F': 1.0} as {'p1': 6.5, 'x': 0.0, 'F': 1.0}
canmatrix encodes {'p1': -1.0, 'x': 0.0, 'F': 1.0} as {'p1': 6553.5, 'x': -5.0, 'F': 3.0}
cantools raises
cantools decodes  {'p1': '6.5', 'x': '-17', 'F': '13.5'}
canmatrix decodes {'p1': '6.5', 'x': '-17', 'F': '13.5'}
saved as dbc     {'p1': '6.5', 'x': '-17', 'F': '13.5'}
saved as json    {'p1': '6.5', 'x': '-17', 'F': '13.5'}
saved as sym     {'p1': '6.5', 'x': '-17', 'F': '2.1737e+09'}
END
