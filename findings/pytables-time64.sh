#!/bin/sh
# PyTables 3.11.1, h5py 3.16.0: times in the column that is made for them can be read by PyTables only.
#
# A table of PyTables with its column for times, `Time64Col`, and one with `Float64Col`. Both are handed out as float seconds by PyTables. In the
# file the first is a type of HDF5 that h5py has no counterpart for: not the time alone, but the whole table, p1 included, raises
# in h5py. The fraction is stored as whole microseconds, so that 0.48 us are gone; the float column keeps them.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile tables==3.11.1 h5py==3.16.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import h5py
import tables

NOW = 1795953600.0  # 29 November 2026


class Times(tables.IsDescription):
    t = tables.Time64Col()
    p1 = tables.Float64Col()


class Floats(tables.IsDescription):
    t = tables.Float64Col()
    p1 = tables.Float64Col()


with tables.open_file("rig.h5", "w") as file:
    for name, kind in (("times", Times), ("floats", Floats)):
        row = (table := file.create_table("/", name, kind)).row
        row["t"], row["p1"] = NOW + 0.00000048, 6.0
        row.append()
        table.flush()
        print(f"PyTables, {name}: {(table[0]['t'] - NOW) * 1e6:.2f} us after the second")
with h5py.File("rig.h5") as file:
    for name in ("floats", "times"):
        try:
            print(f"h5py, {name}: p1", file[name]["p1"][0])
        except TypeError:
            print(f"h5py, {name}: raises")
END
diff - seen <<'END'
PyTables, times: 0.00 us after the second
PyTables, floats: 0.48 us after the second
h5py, floats: p1 6.0
h5py, times: raises
END
