#!/bin/sh
# neurokit2 0.3.0 and spectrum 0.10.0: noise of variance 1 has a density whose integral is 104, 5 million, or 187.
#
# A power density integrated over frequency is the variance, by which one compares sensors, or finds the noise of a
# pressure in a band; for SciPy's `welch` it is 1.0. `signal_psd` of neurokit2 divides by its maximum unless told
# `normalize=False`, so that it has no unit; with `method="fft"` it is no density even then. `Periodogram` of spectrum
# takes no notice of the rate, nor of what its window takes away; with `scale_by_freq` it is multiplied by the rate
# instead of divided. Nothing warns. Check a density against the variance of its own signal first.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile neurokit2==0.3.0 spectrum==0.10.0 numpy==2.4.6 scipy==1.17.1 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import neurokit2
import spectrum
from scipy.signal import welch

noise = np.random.default_rng(0).standard_normal(10000)


def say(what, frequency, density):
    area = np.trapezoid(density, frequency)
    print(f"{what:55s} {area:.2g}" if area > 10 else f"{what:55s} {area:.1f}")


say("SciPy, welch", *welch(noise, fs=1000))
for method in ("welch", "fft"):
    for options in ({}, {"normalize": False}):
        found = neurokit2.signal_psd(noise, sampling_rate=1000, method=method, **options)
        say(f"neurokit2, {method} {options or ''}", found["Frequency"], found["Power"])
for rate in (1, 1000):
    for scale in (False, True):
        found = spectrum.Periodogram(noise, sampling=rate, scale_by_freq=scale)
        found.run()
        say(f"spectrum, sampling={rate}, scale_by_freq={scale}", np.asarray(found.frequencies()), np.asarray(found.psd))
END
diff - seen <<'END'
SciPy, welch                                            1.0
neurokit2, welch                                        1e+02
neurokit2, welch {'normalize': False}                   1.0
neurokit2, fft                                          54
neurokit2, fft {'normalize': False}                     5e+06
spectrum, sampling=1, scale_by_freq=False               0.2
spectrum, sampling=1, scale_by_freq=True                7.4e+08
spectrum, sampling=1000, scale_by_freq=False            1.9e+02
spectrum, sampling=1000, scale_by_freq=True             7.4e+05
END
