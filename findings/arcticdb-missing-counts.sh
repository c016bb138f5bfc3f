#!/bin/sh
# ArcticDB 6.28.2: a column of counts that part of a recording lacks is 0 there, until one float makes it NaN.
#
# Two runs appended in a library with `dynamic_schema`: the second has no column of counts. Reading gives 0 for its
# rows, which a command or a position may well be, and False for a switch; a float that is missing is NaN. A third run
# that has the column as floats changes what was read before: the same rows are NaN now. A mean by `QueryBuilder`
# leaves the zeros out, one of what was read has them. Nothing warns. Convert counts to floats before they are
# appended.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile arcticdb==6.28.2 pandas==2.3.3 numpy==2.3.5
v/bin/python -W ignore - <<'END' | tee seen
import arcticdb
import pandas as pd

library = arcticdb.Arctic("lmdb://store").create_library("axis", arcticdb.LibraryOptions(dynamic_schema=True))
runs = [
    pd.DataFrame({"pressure": [6.0, 6.1], "counts": [512, 514], "switch": [True, True], "leak": [0.1, 0.2]}),
    pd.DataFrame({"pressure": [6.2, 6.3]}),
    pd.DataFrame({"pressure": [6.4, 6.5], "counts": [516.5, 517.5]}),
]
for number, run in enumerate(runs):
    run.index = pd.date_range("2026-01-01", periods=len(run), freq="1ms") + pd.Timedelta(2 * number, "ms")
    library.append("log", run)
    found = library.read("log").data
    print(f"{number + 1} runs:", {name: found[name].tolist() for name in ("counts", "leak")})
    print("  switch:", found["switch"].tolist())
    grouped = arcticdb.QueryBuilder().resample("1s").agg({"counts": "mean"})
    asked = library.read("log", query_builder=grouped).data["counts"].iloc[0]
    print(f"  mean of counts: asked for {asked:g}, of what was read {found['counts'].mean():g}")
END
