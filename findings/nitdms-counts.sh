#!/bin/sh
# nitdms 2.0.7, npTDMS 1.13.0: a scaled TDMS channel is whole counts in nitdms.
#
# A channel of counts -5, 0, 5 with a scale of 2 x + 1, a second one of 10 x behind it, or the scale at its group.
# npTDMS gives -9, 1, 11 and -90, 10, 110; nitdms gives -5, 0, 5 in all, and says nothing. The scales stand among the
# properties of the channel.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile nitdms==2.0.7 npTDMS==1.13.0 numpy==2.3.5
v/bin/python -W ignore - <<'END' | tee seen
import nitdms
import numpy as np
from nptdms import ChannelObject, GroupObject, TdmsFile, TdmsWriter

counts, raw = np.array([-5, 0, 5], "int16"), 0xFFFFFFFF


def linear(number, slope, offset, source=raw):
    texts = {"Scale_Type": "Linear", "Linear_Slope": slope, "Linear_Y_Intercept": offset, "Linear_Input_Source": source}
    return {f"NI_Scale[{number}]_{key}": value for key, value in texts.items()}


one = {"NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled", **linear(0, 2.0, 1.0)}
two = {**one, "NI_Number_Of_Scales": 2, **linear(1, 10.0, 0.0, 0)}
for what, channel, group in (("one scale", one, {}), ("a scale of a scale", two, {}), ("a scale of the group", {}, one)):
    with TdmsWriter("run.tdms", version=4713) as file:
        file.write_segment([GroupObject("rig", group), ChannelObject("rig", "p1", counts, channel)])
    scaled = [float(value) for value in TdmsFile.read("run.tdms")["rig"]["p1"][:]]
    print(f"{what}: npTDMS {scaled}, nitdms {nitdms.TdmsFile('run.tdms').rig.p1.data.tolist()}")
END
diff - seen <<'END'
one scale: npTDMS [-9.0, 1.0, 11.0], nitdms [-5, 0, 5]
a scale of a scale: npTDMS [-90.0, 10.0, 110.0], nitdms [-5, 0, 5]
a scale of the group: npTDMS [-9.0, 1.0, 11.0], nitdms [-5, 0, 5]
END
