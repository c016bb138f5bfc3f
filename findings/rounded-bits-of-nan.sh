#!/bin/sh
# numcodecs 0.16.6 and netCDF4 1.7.5: a missing reading packed by rounding its bits is a pressure of 0, or an overload.
#
# There are many NaN: a processor makes 7fc00000, but erased memory or a bus without answer is ffffffff. `BitRound` of
# numcodecs adds half a bit to all of them; the second kind overflows and comes back as 0 or -0, whatever the bits kept,
# so that a lost sensor reads no pressure. netCDF4 with `quantize_mode="BitRound"` keeps NaN, but "GranularBitRound"
# makes -0 of an infinity (an overload), and "BitGroom" makes NaN of it. Nothing warns. Replace missing readings by
# `numpy.nan` before packing, or take zlib alone.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile numcodecs==0.16.6 netCDF4==1.7.5.1.post1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import netCDF4
import numpy as np
from numcodecs import BitRound

marks = {"NaN": 0x7FC00000, "all bits set": 0xFFFFFFFF, "all but the sign": 0x7FFFFFFF, "infinity": 0x7F800000}
marks["6.25"] = 0x40C80000
readings = np.array(list(marks.values()), "u4").view("f4")
packed = {f"numcodecs, {bits} bits": BitRound(bits).encode(readings.copy()).view("f4") for bits in (8, 16)}
with netCDF4.Dataset("log.nc", "w") as file:
    file.createDimension("time", readings.size)
    for mode in ("BitRound", "GranularBitRound", "BitGroom"):
        rounded = {"significant_digits": 3, "quantize_mode": mode}
        file.createVariable(mode, "f4", ("time",), compression="zlib", **rounded)[:] = readings
with netCDF4.Dataset("log.nc") as file:
    file.set_auto_mask(False)
    packed |= {f"netCDF4, {mode}": file[mode][:] for mode in file.variables}
print("stored:", ", ".join(f"{name} ({value:g})" for name, value in zip(marks, readings)))
for name, found in packed.items():
    print(f"{name}:", *(f"{value:.3g}" for value in found))
END
diff - seen <<'END'
stored: NaN (nan), all bits set (nan), all but the sign (nan), infinity (inf), 6.25 (6.25)
numcodecs, 8 bits: nan 0 -0 inf 6.25
numcodecs, 16 bits: nan 0 -0 inf 6.25
netCDF4, BitRound: nan nan nan inf 6.5
netCDF4, GranularBitRound: nan nan nan -0 6.25
netCDF4, BitGroom: nan nan nan nan 6.25
END
