#!/bin/sh
# AllanTools 2024.6: by its Allan deviation a sensor's white noise averages out with 1/n, where it does with 1/sqrt(n).
#
# All its deviations take what they are given for phase, the integral of a clock's frequency, unless `data_type="freq"`
# is said. Readings of a sensor are the frequency. White noise of 1 Pa has at 1, 10 and 100 s 1.7, 0.17 and 0.017 for
# 1.0, 0.32 and 0.10: averaging for 100 s seems to bring six times what it brings, and the slope of -1 is read as
# quantisation. A drift of 1 Pa/s has no deviation at all. allan-variance takes readings for readings. One NaN, and all
# is NaN. Nothing warns. State `data_type`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile AllanTools==2024.6 allan-variance==1.0 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import allantools
import numpy as np
from allan_variance import compute_avar

spans = [1, 10, 100]
noise = np.random.default_rng(0).standard_normal(100_000)
lost = noise.copy()
lost[5] = np.nan
for what, pressure in (("white noise", noise), ("drift of 1 Pa/s", np.arange(100_000.0)), ("noise, one NaN", lost)):
    for name, options in (("all else default", {}), ("freq", {"data_type": "freq"})):
        found = allantools.oadev(pressure, rate=1.0, taus=spans, **options)[1]
        print(f"{what}, AllanTools, {name}:", *(f"{value:.2g}" for value in found))
found = dict(zip(*compute_avar(noise, 1.0)))
print("white noise, allan-variance:", *(f"{found[span] ** 0.5:.2g}" for span in spans[:2]))
END
diff - seen <<'END'
white noise, AllanTools, all else default: 1.7 0.17 0.017
white noise, AllanTools, freq: 1 0.32 0.1
drift of 1 Pa/s, AllanTools, all else default: 0 0 0
drift of 1 Pa/s, AllanTools, freq: 0.71 7.1 71
noise, one NaN, AllanTools, all else default: nan nan nan
noise, one NaN, AllanTools, freq: nan nan nan
white noise, allan-variance: 1 0.32
END
