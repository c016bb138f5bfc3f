#!/bin/sh
# SciPy 1.17.1: `wavfile` reads samples of 24 bits as 256 times what the recorder wrote.
#
# Acoustic and vibration recorders write WAV of 24 bits. The samples -5, 0, 5, 10 are -1280, 0, 1280, 2560: they stand
# in the upper bits of 32, and those of 16 bits stand as they are, so that one scale in counts does for one recorder and
# not for the other. Unsigned samples of 8 bits come with their 128 in. Python's `wave` gives the bytes, soundfile parts
# of full scale. Nothing warns. Divide by 2^31, not by 2^23.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import io
import wave

from scipy.io import wavfile

for size in (1, 2, 3, 4):
    file = io.BytesIO()
    with wave.open(file, "wb") as out:
        out.setparams((1, size, 1000, 0, "NONE", ""))
        zero = 128 if size == 1 else 0
        out.writeframes(b"".join((zero + n).to_bytes(size, "little", signed=size > 1) for n in (-5, 0, 5, 10)))
    file.seek(0)
    rate, values = wavfile.read(file)
    print(f"{8 * size:2d} bits  {values.dtype.name:6s}", *values)
END
diff - seen <<'END'
 8 bits  uint8  123 128 133 138
16 bits  int16  -5 0 5 10
24 bits  int32  -1280 0 1280 2560
32 bits  int32  -5 0 5 10
END
