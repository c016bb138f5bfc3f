#!/bin/sh
# NumPy 2.4.6 and Python's sqlite3: counts and 32-bit readings become blobs, whose average is 0 and which pass any limit.
#
# A log inserts what a driver gives it: numpy.int64, numpy.float32. sqlite3 knows neither, takes the bytes of memory for
# them, and SQLite stores a blob even in a column of INTEGER or REAL. Then `avg` and `sum` are 0, `p > 7` is true for
# all rows, as a blob is above any number, and pandas reads a column of bytes. numpy.float64 is a float of Python and
# right; so is a list that went through `tolist`, and pandas' `to_sql`. Nothing raises or warns. Register adapters
# (`sqlite3.register_adapter(numpy.int64, int)`), or call `item()` on each.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile numpy==2.4.6 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import sqlite3

import numpy as np
import pandas as pd

base = sqlite3.connect(":memory:")
base.execute("create table log (counts integer, p32 real, p64 real)")


def say(what):
    kinds = base.execute("select typeof(counts), typeof(p32), typeof(p64) from log limit 1").fetchone()
    means = base.execute("select avg(counts), avg(p32), avg(p64) from log").fetchone()
    above = base.execute("select count(*) from log where p32 > 7").fetchone()[0]
    print(f"{what}: stored as {', '.join(kinds)}; means {means}; rows with p32 > 7: {above} of 3", end="; ")
    print("read by pandas:", *map(repr, pd.read_sql("select counts, p32 from log limit 1", base).iloc[0]))
    base.execute("delete from log")


readings = [(np.int64(counts), np.float32(counts / 4), np.float64(counts / 4)) for counts in (20, 24, 28)]
base.executemany("insert into log values (?, ?, ?)", readings)
say("as NumPy gives them")
base.executemany("insert into log values (?, ?, ?)", [[value.item() for value in row] for row in readings])
say("item() of each")
frame = pd.DataFrame(readings, columns=["counts", "p32", "p64"]).astype({"p32": "f4"})
frame.to_sql("log", base, if_exists="append", index=False)
say("to_sql")
END
diff - seen <<'END'
as NumPy gives them: stored as blob, blob, real; means (0.0, 0.0, 6.0); rows with p32 > 7: 3 of 3; read by pandas: b'\x14\x00\x00\x00\x00\x00\x00\x00' b'\x00\x00\xa0@'
item() of each: stored as integer, real, real; means (24.0, 6.0, 6.0); rows with p32 > 7: 0 of 3; read by pandas: 20.0 5.0
to_sql: stored as integer, real, real; means (24.0, 6.0, 6.0); rows with p32 > 7: 0 of 3; read by pandas: 20.0 5.0
END
