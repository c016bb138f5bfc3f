#!/bin/sh
# MNE 1.13.2: a channel of 100 Hz beside one of 1 kHz in an EDF file is zero where it is cropped, and invented between its samples.
#
# A step from 0 to 8 bar, recorded with 100 Hz, in a file whose fastest channel has 1 kHz and whose records last 1 s. MNE gives
# each channel the fastest rate. Where the file is not loaded at once, as is the default, a piece that begins inside one record and ends
# in another one is all zeros for the slow channel, in the middle of 8 bar, for `get_data` and for `crop` alike; the fast channel
# beside it says 8. The warning speaks of edge artifacts. Loaded at once, the slow channel swings to 9.1 and -1.1 bar around the
# step, and also at the beginning and the end, where nothing moves, since it is taken for periodic.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile mne==1.13.2 edfio==0.4.18 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import mne
import numpy as np
from edfio import Edf, EdfSignal

mne.set_log_level("ERROR")


def signal(label, rate):
    step = np.repeat([0.0, 8.0], 5 * rate)
    return EdfSignal(step, rate, label=label, physical_dimension="bar", physical_range=(-10, 10))


def span(values):
    return f"{values.min():.1f} to {values.max():.1f} bar"


Edf([signal("slow", 100), signal("fast", 1000)], data_record_duration=1).write("rig.edf")
recording = mne.io.read_raw_edf("rig.edf", preload=False)
for start, stop in ((7.0, 7.9), (7.0, 9.0), (6.9, 7.9), (6.9, 9.0), (6.999, 7.001)):
    found = (span(recording.get_data(name, tmin=start, tmax=stop)) for name in ("slow", "fast"))
    print(f"{start} to {stop} s:", *(f"{name} {values}" for name, values in zip(("slow", "fast"), found, strict=True)))
cropped = recording.copy().crop(6.9, 7.9).load_data()
print("cropped to 6.9 to 7.9 s, then loaded: slow", span(cropped.get_data("slow")))
whole = mne.io.read_raw_edf("rig.edf", preload=True)
print("loaded, then cropped: slow", span(whole.copy().crop(6.9, 7.9).get_data("slow")))
slow = whole.get_data("slow")[0]
print("loaded at once: slow", span(slow), "| at 0 s", *(f"{x:.1f}" for x in slow[:5]), "| at the end", *(f"{x:.1f}" for x in slow[-3:]))
END
diff - seen <<'END'
7.0 to 7.9 s: slow 8.0 to 8.0 bar fast 8.0 to 8.0 bar
7.0 to 9.0 s: slow 8.0 to 8.0 bar fast 8.0 to 8.0 bar
6.9 to 7.9 s: slow 0.0 to 0.0 bar fast 8.0 to 8.0 bar
6.9 to 9.0 s: slow 0.0 to 0.0 bar fast 8.0 to 8.0 bar
6.999 to 7.001 s: slow 0.0 to 0.0 bar fast 8.0 to 8.0 bar
cropped to 6.9 to 7.9 s, then loaded: slow 0.0 to 0.0 bar
loaded, then cropped: slow 8.0 to 8.0 bar
loaded at once: slow -1.1 to 9.1 bar | at 0 s 0.0 -0.5 -0.8 -1.0 -1.1 | at the end 2.2 1.4 0.6
END
