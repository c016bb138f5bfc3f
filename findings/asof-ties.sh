#!/bin/sh
# DuckDB 2.0.1, chDB 4.4.0, pandas 3.1.1, polars 2.1.0: two values of one stamp, and who takes which in an ASOF join.
#
# A command is logged at each step twice, before (0 V) and after (5 V), with one stamp. Joined to readings by "the last row at or
# before", pandas and polars take the row after the step. DuckDB takes the row before it where ten readings are joined, and the row
# after it where a thousand are. chDB takes the row before for ten, and for a thousand now the one, now the other. None warns. So
# a valve's command is late by a whole interval in one tool, and in DuckDB it depends on how much was recorded.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile duckdb==2.0.1 chdb==4.4.0 pandas==3.1.1 polars==2.1.0 numpy==2.4.6 pyarrow==26.0.1
v/bin/python -W ignore - <<'END' | tee seen
import chdb
import duckdb
import numpy as np
import pandas as pd
import polars as pl


def joined(count):
    """Commands that each reading gets, from each tool."""
    stamps = np.arange(count) * 0.001
    readings = pd.DataFrame({"t": stamps, "k": 1})
    commands = pd.DataFrame({"t": np.repeat(stamps, 2), "u": np.tile([0.0, 5.0], count), "k": 1})
    ours = pl.DataFrame(readings.to_dict("list")), pl.DataFrame(commands.to_dict("list"))
    yield "pandas", pd.merge_asof(readings, commands, on="t").u.to_numpy()
    yield "polars", ours[0].join_asof(ours[1], on="t")["u"].to_numpy()
    yield "DuckDB", duckdb.sql("SELECT u FROM readings ASOF JOIN commands USING (t)").fetchnumpy()["u"]
    query = "SELECT u FROM Python(readings) AS r ASOF JOIN Python(commands) AS c ON r.k = c.k AND r.t >= c.t"
    yield "chDB", chdb.query(query, "DataFrame")["u"].to_numpy()


for count in (10, 1000):
    for tool, found in joined(count):
        print(f"{count:4d} readings, {tool}:", " and ".join(f"{value:g} V" for value in np.unique(found)))
END
diff - seen <<'END'
  10 readings, pandas: 5 V
  10 readings, polars: 5 V
  10 readings, DuckDB: 0 V
  10 readings, chDB: 0 V
1000 readings, pandas: 5 V
1000 readings, polars: 5 V
1000 readings, DuckDB: 5 V
1000 readings, chDB: 0 V and 5 V
END
