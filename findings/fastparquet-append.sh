#!/bin/sh
# fastparquet 2026.9.0: what is appended becomes the first run's kind of number: 6.75 bar are 6, and -5 is 65531.
#
# The first run of a log happened to hold whole numbers. `write(..., append=True)` makes whole numbers of the second
# run: decimals are cut, not rounded; a negative count behind unsigned ones, and 70000 behind 16 bits, wrap. No error
# or warning, and pyarrow reads the file so.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile fastparquet==2026.9.0 pyarrow==26.0.1 pandas==3.0.6 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import warnings

import fastparquet
import numpy as np
import pandas as pd
import pyarrow.parquet as pq


def append(what, first, second):
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        fastparquet.write("log.parquet", pd.DataFrame({"p1": first}))
        fastparquet.write("log.parquet", pd.DataFrame({"p1": second}), append=True)
    said = [one.category.__name__ for one in seen]
    print(f"{what}:", pq.read_table("log.parquet")["p1"].to_pylist(), "warned:", said or "nothing")


append("whole numbers, then decimals", [6, 7], [6.25, 6.75])
append("uint16, then int16", np.array([60000], "u2"), np.array([-5, 7], "i2"))
append("int16, then int32", np.array([300], "i2"), np.array([70000], "i4"))
append("float32, then float64", np.array([6.25], "f4"), np.array([6.1]))
append("decimals, then whole numbers", [6.25], [6, 7])
END
diff - seen <<'END'
whole numbers, then decimals: [6, 7, 6, 6] warned: nothing
uint16, then int16: [60000, 65531, 7] warned: nothing
int16, then int32: [300, 4464] warned: nothing
float32, then float64: [6.25, 6.099999904632568] warned: nothing
decimals, then whole numbers: [6.25, 6.0, 7.0] warned: nothing
END
