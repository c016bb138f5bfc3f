#!/bin/sh
# DataFusion 55.0.0, Lance 14.0.2, polars 2.1.0: a missing reading is above a limit, and with the other sign below it.
#
# 5 and 8 bar and two missing readings, NaN and NaN with its sign bit set, as 0/0 and a negated reading leave it. "p > 7"
# finds the one and "p < 7" the other in DataFusion and Lance, which order floats by their bits; highest and lowest are
# NaN both. polars takes both NaN for the largest number, so that "p > 7" has three rows, and leaves them out of its own
# highest. pyarrow's filter leaves both out, as IEEE 754 does. So a count of samples above the relief pressure, or below
# the supply, has missing ones in it, and which depends on how they were made. Nothing prints the sign.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile datafusion==55.0.0 pylance==14.0.2 polars==2.1.0 pyarrow==26.0.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import datafusion
import lance
import numpy as np
import polars as pl
import pyarrow as pa
import pyarrow.compute as pc

table = pa.table({"p": [5.0, 8.0, np.nan, -np.nan]})
context = datafusion.SessionContext()
context.register_record_batches("r", [table.to_batches()])
stored = lance.write_dataset(table, "r.lance")
frame = pl.from_arrow(table)


def counts(limit):
    yield "DataFusion", context.sql(f"SELECT count(*) AS n FROM r WHERE p {limit}").to_pydict()["n"][0]
    yield "Lance", stored.count_rows(f"p {limit}")
    yield "polars", frame.sql(f"SELECT p FROM self WHERE p {limit}").height
    yield "pyarrow", table.filter(pc.field("p") > 7 if limit == "> 7" else pc.field("p") < 7).num_rows


for limit in ("> 7", "< 7"):
    print("rows with p", limit, *(f"  {tool}: {count}" for tool, count in counts(limit)))
print("extremes in DataFusion:", context.sql("SELECT max(p) AS high, min(p) AS low FROM r").to_pydict())
print("extremes in polars:    ", frame.select(high=pl.col("p").max(), low=pl.col("p").min()).to_dicts()[0])
END
diff - seen <<'END'
rows with p > 7   DataFusion: 2   Lance: 2   polars: 3   pyarrow: 1
rows with p < 7   DataFusion: 2   Lance: 2   polars: 1   pyarrow: 1
extremes in DataFusion: {'high': [nan], 'low': [nan]}
extremes in polars:     {'high': 8.0, 'low': 5.0}
END
