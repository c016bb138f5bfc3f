#!/bin/sh
# candied 2.2.0 (npm): of a DBC the Motorola signals, the floats and the multiplexed ones come out wrong, in silence.
#
# Frames that cantools packed. A temperature of -15.5 degC in Motorola order is 10.5 degC, a voltage of 5.123 V is
# 63.904 V: the bits are taken from the wrong places. A pressure stored as a 32-bit float (SIG_VALTYPE_) is 1086849024
# bar for 6.25, its bits as a whole number. In a multiplexed message each frame has all signals, so that a valve voltage
# appears that was never sent, from the bytes of a pressure. Units and names are right, as are little-endian whole
# numbers. Decode with cantools.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . candied@2.2.0
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile cantools==45.1.0
v/bin/python -W ignore - <<'END'
import json
from pathlib import Path

import cantools

axis = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 1 Intel: 8 A
 SG_ p1 : 0|16@1- (0.1,0) [0|0] "bar" A
BO_ 2 Motorola: 8 A
 SG_ T : 23|12@0- (0.5,10) [0|0] "degC" A
 SG_ u : 39|16@0+ (0.001,0) [0|0] "V" A
BO_ 3 Float: 8 A
 SG_ p2 : 0|32@1- (1,0) [0|0] "bar" A
BO_ 4 Multiplexed: 8 A
 SG_ mux M : 0|8@1+ (1,0) [0|0] "" A
 SG_ p3 m0 : 8|16@1- (0.1,0) [0|0] "bar" A
 SG_ u3 m1 : 8|16@1- (0.01,0) [0|0] "V" A
SIG_VALTYPE_ 3 p2 : 1;
"""
Path("axis.dbc").write_text(axis)
database = cantools.database.load_string(axis, "dbc")
sent = [(1, {"p1": -20}), (2, {"T": -15.5, "u": 5.123}), (3, {"p2": 6.25})]
sent += [(4, {"mux": 0, "p3": 6.5}), (4, {"mux": 1, "u3": -2.5})]
frames = [{"id": one, "data": list(database.encode_message(one, values)), "sent": values} for one, values in sent]
Path("frames.json").write_text(json.dumps(frames))
END
cat >run.cjs <<'END'
const { readFileSync } = require("fs");
const { Can, Dbc } = require("candied");

const can = new Can();
can.database = new Dbc().load(readFileSync("axis.dbc", "utf8"));
for (const { id, data, sent } of JSON.parse(readFileSync("frames.json"))) {
  const found = [...can.decode(can.createFrame(id, data)).boundSignals];
  const read = found.map(([name, signal]) => `${name} ${signal.physValue}`).join(", ");
  console.log("sent", JSON.stringify(sent), "read", read);
}
END
node run.cjs | tee seen
diff - seen <<'END'
sent {"p1":-20} read p1 -20 bar
sent {"T":-15.5,"u":5.123} read T 10.5 degC, u 63.904 V
sent {"p2":6.25} read p2 1086849024 bar
sent {"mux":0,"p3":6.5} read mux 0, p3 6.5 bar, u3 0.65 V
sent {"mux":1,"u3":-2.5} read mux 1, p3 -25 bar, u3 -2.5 V
END
