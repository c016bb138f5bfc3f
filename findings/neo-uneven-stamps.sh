#!/bin/sh
# neo 0.14.6: resampling a recording with uneven stamps moves its values to other times, and rings.
#
# A ramp of 1 bar/s over 2 s, 10 readings in the first second and 100 in the second, as an `IrregularlySampledSignal`.
# `resample(50)` returns an even signal over the same 2 s. Its values are those of a Fourier resampling by number of
# sample: at 0.5 s it has 1.2 bar for 0.5, at 1 s 1.5 for 1.0, and at both ends it swings by half a bar, as the end is
# joined to the start. Nothing warns. Its help says "interpolates". Interpolate with numpy over the stamps, and give the
# result to `AnalogSignal`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile neo==0.14.6 quantities==0.16.4 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import neo
import numpy as np
import quantities as pq

stamps = np.r_[np.arange(0, 1, 0.1), np.arange(1, 2, 0.01)]
signal = neo.IrregularlySampledSignal(stamps * pq.s, stamps, units="bar")
even = signal.resample(50)
times, values = even.times.rescale("s").magnitude, even.magnitude.ravel()
for wanted in (0, 0.25, 0.5, 1, 1.5, 1.95):
    place = int(np.argmin(abs(times - wanted)))
    print(f"at {times[place]:.2f} s: {values[place]:.2f} bar, true {times[place]:.2f}")
END
diff - seen <<'END'
at 0.00 s: 0.55 bar, true 0.00
at 0.24 s: 1.04 bar, true 0.24
at 0.49 s: 1.16 bar, true 0.49
at 1.02 s: 1.46 bar, true 1.02
at 1.50 s: 1.73 bar, true 1.50
at 1.95 s: 1.87 bar, true 1.95
END
