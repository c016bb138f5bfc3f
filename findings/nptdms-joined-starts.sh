#!/bin/sh
# npTDMS 1.13.0: `as_dataframe(time_index=True)` lays channels that were started at different times at one zero.
#
# A recorder starts p2 half a second after p1, and both waveforms say their start. The index of the frame counts from
# the start of each channel by itself, so that both begin at 0 and stand in the same rows. With `absolute_time=True`
# they are half a second apart. Without an index the rows are numbers, whatever the rates: sample 2 of a channel of
# 250 Hz stands beside sample 2 of one of 1 kHz. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile npTDMS==1.13.0 numpy==2.4.6 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter


def channel(name, start, step, count):
    timing = {"wf_increment": step, "wf_start_time": np.datetime64(f"2026-03-11T09:15:{start}"), "wf_start_offset": 0.0}
    return ChannelObject("g", name, np.arange(float(count)), timing)


def show(what, frame):
    for name in frame:
        rows = frame[name].dropna()
        seconds = rows.index if rows.index.dtype.kind in "if" else (rows.index - frame.index[0]).total_seconds()
        print(f"{what:14s} {name[-3:-1]}", *(f"{at:g}" for at in seconds))


with TdmsWriter("run.tdms") as file:
    file.write_segment([channel("p1", "00.000", 0.001, 4), channel("p2", "00.500", 0.001, 4)])
with TdmsWriter("rates.tdms") as file:
    file.write_segment([channel("p1", "00.000", 0.001, 4), channel("p2", "00.000", 0.004, 2)])
run = TdmsFile.read("run.tdms")
show("time_index", run.as_dataframe(time_index=True))
show("absolute_time", run.as_dataframe(time_index=True, absolute_time=True))
show("rates, plain", TdmsFile.read("rates.tdms").as_dataframe())
END
diff - seen <<'END'
time_index     p1 0 0.001 0.002 0.003
time_index     p2 0 0.001 0.002 0.003
absolute_time  p1 0 0.001 0.002 0.003
absolute_time  p2 0.5 0.501 0.502 0.503
rates, plain   p1 0 1 2 3
rates, plain   p2 0 1
END
