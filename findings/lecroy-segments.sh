#!/bin/sh
# lecroyparser 1.4.2, lecroyscope 1.0.0, lecroyutils 4.0.2: a trace of LeCroy whose clock is stretched and whose pauses are gone.
#
# A .trc of 1000 samples at 10 kHz: lecroyparser and lecroyutils spread the stamps over one interval more than there is,
# 100.1 us for 100, so that the last is late by one; lecroyscope has 100. Five segments of 200 samples, triggered each
# second: lecroyparser returns one record of 0.1 s without a gap, of which no attribute but the length of the table of
# triggers tells. lecroyscope returns five rows and stamps of the first, and no trigger's time. lecroyutils alone reads
# those. Compute `row * interval`, and look at the number of segments in the file.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile lecroyparser==1.4.2 lecroyscope==1.0.0 lecroyutils==4.0.2 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import struct

import lecroyparser
import lecroyscope
import numpy as np
from lecroyutils.data import LecroyScopeData


def write(path, segments, length):
    """A trace of rising counts of 1 mV at 10 kHz, little endian, in segments that are triggered each second."""
    counts = np.arange(segments * length, dtype="<i2")
    pairs = [(second, -0.005) for second in range(segments)] if segments > 1 else []
    head = bytearray(346)
    fields = {0: ("16s", b"WAVEDESC"), 16: ("16s", b"LECROY_2_3"), 32: ("2H", 1, 1), 36: ("i", 346), 48: ("i", 16 * len(pairs)),
              60: ("i", counts.nbytes), 76: ("16s", b"LECROY"), 116: ("4i", counts.size, counts.size, 0, counts.size - 1),
              136: ("4i", 1, 0, segments, 1), 156: ("4f", 0.001, 0, 32767, -32768), 172: ("2h", 12, segments),
              176: ("<fd", 1e-4, -0.005), 196: ("48s", b"V"), 244: ("48s", b"S"), 296: ("<dBBBBh", 0.5, 0, 12, 1, 1, 2026),
              324: ("2H", 20, 2), 328: ("f", 1)}  # fmt: skip
    for place, (form, *values) in fields.items():
        struct.pack_into("<" + form.lstrip("<"), head, place, *values)
    body = bytes(head) + b"".join(struct.pack("<2d", *pair) for pair in pairs) + counts.tobytes()
    with open(path, "wb") as file:
        file.write(b"#9%09d" % len(body) + body)


def show(tool, values, stamps):
    time = np.asarray(stamps).ravel("F")
    print(f"  {tool}: {np.shape(values)}, interval {1e6 * (time[1] - time[0]):.1f} us, {time[0]:.3f} to {time[-1]:.3f} s")


for segments, length in ((1, 1000), (5, 200)):
    write("a.trc", segments, length)
    print(f"segments of {length} samples: {segments}")
    parsed, traced = lecroyparser.ScopeData("a.trc"), lecroyscope.Trace("a.trc")
    show("lecroyparser", parsed.y, parsed.x)
    show("lecroyscope", traced.voltage, traced.time)
    parsed = LecroyScopeData.parse_file("a.trc")
    show("lecroyutils", parsed.y, parsed.x)
END
diff - seen <<'END'
segments of 1000 samples: 1
  lecroyparser: (1000,), interval 100.1 us, -0.005 to 0.095 s
  lecroyscope: (1000,), interval 100.0 us, -0.005 to 0.095 s
  lecroyutils: (1000,), interval 100.1 us, -0.005 to 0.095 s
segments of 200 samples: 5
  lecroyparser: (1000,), interval 100.1 us, -0.005 to 0.095 s
  lecroyscope: (5, 200), interval 100.0 us, -0.005 to 0.015 s
  lecroyutils: (200, 5), interval 100.5 us, -0.005 to 4.015 s
END
