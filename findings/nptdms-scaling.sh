#!/bin/sh
# npTDMS 1.13.0: which scales of a TDMS channel count, and how two of them are subtracted.
#
# A channel of counts -5 to 10 has the scale 2 x + 1. With the property NI_Scaling_Status = "scaled" the stored numbers
# are physical already, and the scale is not applied; with "unscaled", or without the property, it is. A scale that a
# group or the root states holds for their channels. A subtraction of inputs 0 (2 x + 1) and 1 (x) gives right minus
# left, -x - 1, where the names of its properties (left operand, right operand) suggest x + 1.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile npTDMS==1.13.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsFile, TdmsWriter

counts = np.array([-5, 0, 5, 10], "int16")
raw_input = 0xFFFFFFFF


def linear(number, slope, offset):
    texts = {"Scale_Type": "Linear", "Linear_Slope": slope, "Linear_Y_Intercept": offset, "Linear_Input_Source": raw_input}
    return {f"NI_Scale[{number}]_{key}": value for key, value in texts.items()}


def read(what, channel, group=None, root=None):
    with TdmsWriter("run.tdms") as file:
        file.write_segment([RootObject(root or {}), GroupObject("g", group or {}), ChannelObject("g", "p1", counts, channel)])
    print(f"{what:10s}", *(f"{value:g}" for value in TdmsFile.read("run.tdms")["g"]["p1"][:]))


one = {"NI_Number_Of_Scales": 1, **linear(0, 2.0, 1.0)}
read("channel", one)
read("unscaled", {**one, "NI_Scaling_Status": "unscaled"})
read("scaled", {**one, "NI_Scaling_Status": "scaled"})
read("group", {}, group=one)
read("root", {}, root=one)
difference = {"NI_Scale[2]_Scale_Type": "Subtract", "NI_Scale[2]_Subtract_Left_Operand_Input_Source": 0}
difference["NI_Scale[2]_Subtract_Right_Operand_Input_Source"] = 1
read("difference", {**linear(0, 2.0, 1.0), **linear(1, 1.0, 0.0), **difference, "NI_Number_Of_Scales": 3})
END
diff - seen <<'END'
channel    -9 1 11 21
unscaled   -9 1 11 21
scaled     -5 0 5 10
group      -9 1 11 21
root       -9 1 11 21
difference 4 -1 -6 -11
END
