#!/bin/sh
# pyabf 2.3.8: a rate of 2.5 Hz comes back as 2 Hz, 3 kHz as 2999 Hz, and a pressure in Pa in steps of 122 Pa.
#
# `writeABF1` keeps the period, the reader its inverse, cut to a whole number: 2.5 Hz has stamps that end at 1499.5 s
# where the recording has 1199.6 s, and 3, 6 and 7 kHz lose a hertz to rounding. Readings are stored in 16 bits of a
# range that is a power of ten times a factor: a pressure of 6 bar with 1 Pa of noise has, in Pa, a single value but for
# its spike. The caller is told neither the step nor the rate. NaN raises. Take `row / rate` as clock, and write
# readings less their mean.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pyabf==2.3.8 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import pyabf
from pyabf.abfWriter import writeABF1

wave = np.sin(np.arange(3000) / 50)[None] * 6
for rate in (2.5, 333.3, 1000, 3000, 6000, 7000, 30000):
    writeABF1(wave, "a.abf", rate, units="bar")
    found = pyabf.ABF("a.abf")
    stamps = f"last stamp {found.sweepX[-1]:.6g} s for {2999 / rate:.6g} s"
    print(f"written at {rate:g} Hz: read at {found.dataRate} Hz, {stamps}")
pressure = 6e5 + np.random.default_rng(0).standard_normal((1, 3000))
pressure[0, 10] += 100
for unit, factor in (("Pa", 1), ("bar", 1e-5)):
    writeABF1(pressure * factor, "a.abf", 1000, units=unit)
    back = np.unique(pyabf.ABF("a.abf").sweepY.astype(float) / factor)
    print(f"6 bar with 1 Pa of noise, written in {unit}: {back.size} values, a step of {np.diff(back).min():.0f} Pa")
END
diff - seen <<'END'
written at 2.5 Hz: read at 2 Hz, last stamp 1499.5 s for 1199.6 s
written at 333.3 Hz: read at 333 Hz, last stamp 9.00601 s for 8.9979 s
written at 1000 Hz: read at 1000 Hz, last stamp 2.999 s for 2.999 s
written at 3000 Hz: read at 2999 Hz, last stamp 1 s for 0.999667 s
written at 6000 Hz: read at 5999 Hz, last stamp 0.499917 s for 0.499833 s
written at 7000 Hz: read at 6999 Hz, last stamp 0.42849 s for 0.428429 s
written at 30000 Hz: read at 30000 Hz, last stamp 0.0999667 s for 0.0999667 s
6 bar with 1 Pa of noise, written in Pa: 2 values, a step of 122 Pa
6 bar with 1 Pa of noise, written in bar: 2 values, a step of 122 Pa
END
