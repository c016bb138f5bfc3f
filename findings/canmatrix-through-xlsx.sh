#!/bin/sh
# canmatrix 1.3.3: a DBC through its own XLSX and back: a position of 5 mm is -195, one of -20.5 is 6333.1, a float is a count.
#
# A sheet is how a communication matrix goes from one department to another. `canconvert` writes a signal's range into it, and on the
# way back takes the lowest value of the range for the offset where the range begins below zero and the offset is 0; that a signal
# has a sign, or is a float, is not in the sheet. What has an offset of its own, or no sign and a range from 0, is right. The
# same DBC read by cantools 45.1.0 on both sides. Nothing raises or warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile canmatrix==1.3.3 cantools==45.1.0 openpyxl==3.1.5 xlsxwriter==3.3.1
v/bin/python -W ignore - <<'END' | tee seen
import cantools
import canmatrix.formats as formats

TEXT = """VERSION ""
BU_: ECU
BO_ 256 Axis: 8 ECU
 SG_ p1 : 0|16@1+ (0.01,0) [0|100] "bar" ECU
 SG_ x : 16|16@1- (0.1,0) [-200|200] "mm" ECU
 SG_ T : 32|16@1+ (0.1,-40) [-40|200] "degC" ECU
BO_ 257 Valve: 8 ECU
 SG_ u : 0|32@1- (1,0) [0|0] "V" ECU
SIG_VALTYPE_ 257 u : 1;
"""
with open("rig.dbc", "w") as file:
    file.write(TEXT)
formats.dumpp({"": formats.loadp_flat("rig.dbc")}, "rig.xlsx")
formats.dumpp({"": formats.loadp_flat("rig.xlsx")}, "back.dbc")
before, after = cantools.database.load_file("rig.dbc"), cantools.database.load_file("back.dbc")
frames = [("Axis", {"p1": 6.25, "x": x, "T": 21.5}) for x in (5.0, -20.5)] + [("Valve", {"u": -2.5})]
for name, sent in frames:
    got = after.get_message_by_name(name).decode(before.encode_message(name, sent))
    print(name, ", ".join(f"{key} {value:g} -> {got[key]:g}" for key, value in sent.items()))
END
diff - seen <<'END'
Axis p1 6.25 -> 6.25, x 5 -> -195, T 21.5 -> 21.5
Axis p1 6.25 -> 6.25, x -20.5 -> 6333.1, T 21.5 -> 21.5
Valve u -2.5 -> 3.22332e+09
END
