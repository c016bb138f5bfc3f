#!/bin/sh
# DuckDB 2.0.1: a recording that begins with 20 s at rest is read as whole numbers, and the motion after it is rounded away.
#
# A CSV or JSON file with a position of 0 (written as `0`) for 25 s at 1 kHz, then up to 0.4999 m. DuckDB takes the type from the
# first 20 480 rows, whole numbers, and rounds the decimals after them to that type, without error or warning: the axis never
# moves. A pressure of 0.7 bar is 1. With 5 s at rest in front, or with `sample_size=-1`, the file is read right.
# A NaN in that column, which no whole number can hold, is an error.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile duckdb==2.0.1
v/bin/python -W ignore - <<'END' | tee seen
import json
import pathlib

import duckdb


def position(row, rest):
    return 0 if row < rest else round((row - rest) * 1e-4, 4)


def show(what, source):
    kind, count, top = duckdb.sql(f"SELECT typeof(x), count(DISTINCT x), max(x) FROM {source} GROUP BY 1").fetchall()[0]
    print(f"{what:26s} {kind:7s} different positions {count:5d}, highest {top}")


for rest in (25000, 5000):
    rows = [(row / 1000, position(row, rest)) for row in range(rest + 5000)]
    pathlib.Path("axis.csv").write_text("t,x\n" + "".join(f"{t},{x}\n" for t, x in rows))
    pathlib.Path("axis.json").write_text("\n".join(json.dumps({"t": t, "x": x}) for t, x in rows))
    show(f"CSV, {rest / 1000:.0f} s at rest", "'axis.csv'")
    show(f"JSON, {rest / 1000:.0f} s at rest", "'axis.json'")
    if rest == 25000:
        show("CSV, sample_size=-1", "read_csv('axis.csv', sample_size=-1)")
pathlib.Path("p.csv").write_text("t,x\n" + "".join(f"{row},{0 if row < 25000 else 0.7}\n" for row in range(26000)))
show("pressure of 0.7", "'p.csv'")
pathlib.Path("p.csv").write_text("t,x\n" + "".join(f"{row},{0 if row < 25000 else 'nan'}\n" for row in range(26000)))
try:
    show("NaN", "'p.csv'")
except duckdb.ConversionException:
    print("NaN: raises")
END
diff - seen <<'END'
CSV, 25 s at rest          BIGINT  different positions     1, highest 0
JSON, 25 s at rest         BIGINT  different positions     1, highest 0
CSV, sample_size=-1        DOUBLE  different positions  5000, highest 0.4999
CSV, 5 s at rest           DOUBLE  different positions  5000, highest 0.4999
JSON, 5 s at rest          DOUBLE  different positions  5000, highest 0.4999
pressure of 0.7            BIGINT  different positions     2, highest 1
NaN: raises
END
