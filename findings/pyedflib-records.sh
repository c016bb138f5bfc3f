#!/bin/sh
# pyEDFlib 0.1.42: EDF is filled up with the lowest or a zero pressure, and clips in silence; edfio 0.4.18 refuses all of it.
#
# EDF stores whole records. A recording of 2.5 s at 100 Hz comes back with 300 samples, the last 50 of them 0 bar, where the
# range of the channel has a zero, else its lowest value. 333.3 Hz need records of 10 s: of 1000 samples, 3 s, 3333 come back.
# A reading above the range becomes its end, NaN its lowest value. There is no warning and no count of what was measured.
# edfio raises in each case.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pyEDFlib==0.1.42 edfio==0.4.18 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import edfio
import numpy as np
import pyedflib


def show(what, values, rate=100.0, low=0.0, high=10.0):
    with pyedflib.EdfWriter("a.edf", 1, pyedflib.FILETYPE_EDFPLUS) as writer:
        writer.setSignalHeaders([{"label": "p1", "dimension": "bar", "sample_frequency": rate, "physical_min": low,
                                  "physical_max": high, "digital_min": -32768, "digital_max": 32767, "transducer": "", "prefilter": ""}])
        writer.writeSamples([values])
    with pyedflib.EdfReader("a.edf") as reader:
        back = reader.readSignal(0)
    try:
        edfio.Edf([edfio.EdfSignal(values, rate, label="p1", physical_dimension="bar", physical_range=(low, high))]).write("b.edf")
        other = "edfio writes it"
    except ValueError:
        other = "edfio raises"
    print(f"{what:17s} {len(values):4d} -> {len(back):4d} samples, {values[1]:.2f} -> {back[1]:.2f}, last {back[-1]:.2f} bar; {other}")


show("2 s", np.full(200, 6.0))
show("2.5 s", np.full(250, 6.0))
show("2.5 s, 1..10 bar", np.full(250, 6.0), low=1.0)
show("2.5 s, -1..10 bar", np.full(250, 6.0), low=-1.0)
show("333.3 Hz", np.full(1000, 6.0), rate=333.3)
show("too high", np.r_[6.0, 12.0, np.full(98, 6.0)])
show("NaN", np.r_[6.0, np.nan, np.full(98, 6.0)])
END
diff - seen <<'END'
2 s                200 ->  200 samples, 6.00 -> 6.00, last 6.00 bar; edfio writes it
2.5 s              250 ->  300 samples, 6.00 -> 6.00, last 0.00 bar; edfio raises
2.5 s, 1..10 bar   250 ->  300 samples, 6.00 -> 6.00, last 1.00 bar; edfio raises
2.5 s, -1..10 bar  250 ->  300 samples, 6.00 -> 6.00, last 0.00 bar; edfio raises
333.3 Hz          1000 -> 3333 samples, 6.00 -> 6.00, last 0.00 bar; edfio raises
too high           100 ->  100 samples, 12.00 -> 10.00, last 6.00 bar; edfio raises
NaN                100 ->  100 samples, nan -> 0.00, last 6.00 bar; edfio raises
END
