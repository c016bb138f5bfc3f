#!/bin/sh
# pandas 3.1.1 with PyTables, read by h5py 3.16.0: what a frame's stamps are in HDF5.
#
# to_hdf stores stamps as integers of the index's own unit, which in pandas 3 is the microsecond unless something says
# otherwise; up to pandas 2 it was the nanosecond. An attribute has the unit: "kind" of the index in the fixed format,
# "index_kind" of the table in the other. A column of stamps has it elsewhere, in "value_type" and "values_block_1_dtype".
# A time since the start is stored alike, as "timedelta64[ns]". A reader that knows none of them is wrong by 1000.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pandas==3.1.1 tables==3.11.1 h5py==3.16.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import h5py
import pandas as pd

stamps = pd.date_range("2026-01-01", periods=2, freq="10ms")
texts = ("kind", "index_kind", "value_type", "values_block_1_dtype")


def show(what, index, form):
    frame = pd.DataFrame({"p1": [1.0, 2.0], "stamp": stamps}, index=index)
    frame.to_hdf("a.h5", key="k", mode="w", format=form)
    with h5py.File("a.h5") as file:
        node = file["k/axis1"] if form == "fixed" else file["k/table"]
        column = file["k/block1_values"] if form == "fixed" else node
        first = node[1] - node[0] if form == "fixed" else node["index"][1] - node["index"][0]
        found = {key: one.attrs[key].decode() for one in (node, column) for key in texts if key in one.attrs}
    print(f"{what}, {form}: 10 ms are {first},", ", ".join(f"{key} {value}" for key, value in found.items()))


for form in ("fixed", "table"):
    show("stamps", stamps, form)
    show("nanoseconds", stamps.as_unit("ns"), form)
show("since the start", pd.to_timedelta([0, 0.01], unit="s"), "fixed")
END
diff - seen <<'END'
stamps, fixed: 10 ms are 10000, kind datetime64[us], value_type datetime64[us]
nanoseconds, fixed: 10 ms are 10000000, kind datetime64[ns], value_type datetime64[us]
stamps, table: 10 ms are 10000, index_kind datetime64[us], values_block_1_dtype datetime64[us]
nanoseconds, table: 10 ms are 10000000, index_kind datetime64[ns], values_block_1_dtype datetime64[us]
since the start, fixed: 10 ms are 10000000, kind timedelta64[ns], value_type datetime64[us]
END
