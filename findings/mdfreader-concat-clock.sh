#!/bin/sh
# mdfreader 4.3: two joined recordings have clocks that run apart, and a written copy has lost its date and its words.
#
# `concat_mdf` puts the second recording behind the first, each group by its own last stamp and mean step. Two groups of one
# recording, pressures at 10 Hz and a slow temperature, are shifted by 1.0 s and 1.3 s: events that were at one time are 0.3 s apart
# afterwards. A copy by `write` begins in 1970, and each letter of the words of a state is followed by three zero bytes.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile mdfreader==4.3 asammdf==8.8.28 numpy==2.4.6 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import datetime
import logging

import mdfreader
import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.conversion_utils import from_dict

logging.disable(logging.CRITICAL)
fast, slow = np.arange(10) * 0.1, np.array([0.1, 0.5, 0.9])
words = from_dict({"val_0": 0, "text_0": "shut", "val_1": 1, "text_1": "open"})
file = MDF(version="4.10")
file.header.start_time = datetime.datetime(2026, 11, 29, 12, tzinfo=datetime.timezone.utc)
pressure, state = Signal(fast.copy(), fast, name="p1", unit="bar"), Signal((fast > 0.4).astype("uint8"), fast, name="state", conversion=words)
file.append([pressure, state], common_timebase=True)
file.append([Signal(slow.copy(), slow, name="T", unit="degC")])
file.save("rig.mf4")
first, second = mdfreader.Mdf("rig.mf4"), mdfreader.Mdf("rig.mf4")
first.concat_mdf(second)
for name in ("p1", "T"):
    stamps, values = first.get_channel_data(first.get_channel_master(name)), first.get_channel_data(name)
    print(f"{name}, second recording: shifted by", *sorted({f"{shift:.1f}" for shift in (stamps - values)[len(values) // 2 :]}), "s")
mdfreader.Mdf("rig.mf4").write("copy.mf4")
copy = MDF("copy.mf4")
print("written in", MDF("rig.mf4").header.start_time.year, "| copy", copy.header.start_time.year)
print("states", *MDF("rig.mf4").get("state").samples[4:6], "| copy", *copy.get("state").samples[4:6])
END
diff - seen <<'END'
p1, second recording: shifted by 1.0 s
T, second recording: shifted by 1.3 s
written in 2026 | copy 1970
states b'shut' b'open' | copy b's\x00\x00\x00h\x00\x00\x00u\x00\x00\x00t' b'o\x00\x00\x00p\x00\x00\x00e\x00\x00\x00n'
END
