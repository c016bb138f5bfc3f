#!/bin/sh
# wfdb 4.3.1: of a recording of 9.5 s converted to EDF the second channel is early by half a second; of one of 5 s nothing is left of it.
#
# EDF holds one channel after the other in each record, of 10 s here. `wfdb_to_edf` writes the last record with as many samples as there are
# and fills up at its end, so that the second channel of that record begins among the rows of the first, and its end is the lowest
# value. Of 5 s all of the position is -0.2 m. After a record that is full comes one more of 10 s, with the lowest of
# all. pyEDFlib 0.1.42 reads the file without a word. The first channel is right until its own end.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile wfdb==4.3.1 pyEDFlib==0.1.42 numpy==2.4.6 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import contextlib
import io

import numpy as np
import pyedflib
import wfdb
from wfdb.io.convert.edf import wfdb_to_edf

for count in (1000, 999, 950, 500):
    time = np.arange(count) / 100
    p, x = 6 + np.sin(2 * time), 0.2 * np.sin(time)
    wfdb.wrsamp("run", fs=100, units=["bar", "m"], sig_name=["p1", "x"], p_signal=np.column_stack([p, x]), fmt=["16", "16"])
    with contextlib.redirect_stdout(io.StringIO()):
        wfdb_to_edf("run")
    with pyedflib.EdfReader("run.edf") as read:
        p_read, x_read, length = read.readSignal(0)[:count], read.readSignal(1)[:count], read.getFileDuration()
    wrong = [np.abs(a - b).max() for a, b in ((p, p_read), (x, x_read))]
    at = count // 4
    print(f"{count / 100:g} s -> {length:g} s: worst p {wrong[0]:.4f} bar, worst x {wrong[1]:.4f} m; x at {at / 100:g} s {x[at]:.4f} -> {x_read[at]:.4f}")
END
diff - seen <<'END'
10 s -> 20 s: worst p 0.0000 bar, worst x 0.0000 m; x at 2.5 s 0.1197 -> 0.1197
9.99 s -> 10 s: worst p 0.0000 bar, worst x 0.0946 m; x at 2.49 s 0.1213 -> 0.1197
9.5 s -> 10 s: worst p 0.0000 bar, worst x 0.2824 m; x at 2.37 s 0.1395 -> 0.0537
5 s -> 10 s: worst p 0.0000 bar, worst x 0.4000 m; x at 1.25 s 0.1898 -> -0.2000
END
