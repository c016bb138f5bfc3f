#!/bin/sh
# polars 2.1.0, DataFusion 55.0.0, fastparquet 2026.9.0: a log that rests at 6 loses all decimals after it.
#
# A gateway in JavaScript writes 6 for 6.0, as JSON does. After a rest of 200 rows come 6.25 and 6.75.
# `polars.from_dicts`, `polars.DataFrame(rows)` and `read_json` choose whole numbers after 100 rows and cut the rest to 6,
# without a word; the same list as a column is refused, and so is the same log as lines of JSON. DataFusion cuts after
# 1000 rows of JSON lines, and refuses the same numbers in a CSV. fastparquet cuts a column of objects. pandas, by its own
# reader of JSON, keeps all. State the schema, or write decimals.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile polars==2.1.0 datafusion==55.0.0 fastparquet==2026.9.0 pandas==3.1.1 pyarrow==26.0.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import io
import json
import pathlib

import datafusion
import fastparquet
import pandas as pd
import polars as pl


def show(what, read):
    try:
        print(f"{what:24s}", *read())
    except Exception as error:
        print(f"{what:24s} refused: {type(error).__name__}")


def stored(frame):
    fastparquet.write("p.parquet", frame)
    return fastparquet.ParquetFile("p.parquet").to_pandas()


for rest in (200, 2000):
    rows = [{"p": 6}] * rest + [{"p": 6.25}, {"p": 6.75}]
    values = [row["p"] for row in rows]
    text, lines = json.dumps(rows), "\n".join(map(json.dumps, rows))
    pathlib.Path("p.json").write_text(lines)
    pathlib.Path("p.csv").write_text("p\n" + "\n".join(map(str, values)))
    print("after a rest of", rest, "rows")
    show("polars from_dicts", lambda: pl.from_dicts(rows)["p"][-2:])
    show("polars DataFrame(rows)", lambda: pl.DataFrame(rows)["p"][-2:])
    show("polars read_json", lambda: pl.read_json(io.BytesIO(text.encode()))["p"][-2:])
    show("polars read_ndjson", lambda: pl.read_ndjson("p.json")["p"][-2:])
    show("polars column", lambda: pl.DataFrame({"p": values})["p"][-2:])
    show("DataFusion read_json", lambda: datafusion.SessionContext().read_json("p.json").to_pydict()["p"][-2:])
    show("DataFusion read_csv", lambda: datafusion.SessionContext().read_csv("p.csv").to_pydict()["p"][-2:])
    show("fastparquet, objects", lambda: stored(pd.DataFrame({"p": pd.Series(values, dtype=object)})).p[-2:])
    show("pandas read_json", lambda: pd.read_json(io.StringIO(lines), lines=True).p[-2:])
END
diff - seen <<'END'
after a rest of 200 rows
polars from_dicts        6 6
polars DataFrame(rows)   6 6
polars read_json         6 6
polars read_ndjson       refused: ComputeError
polars column            refused: TypeError
DataFusion read_json     6.25 6.75
DataFusion read_csv      6.25 6.75
fastparquet, objects     6 6
pandas read_json         6.25 6.75
after a rest of 2000 rows
polars from_dicts        6 6
polars DataFrame(rows)   6 6
polars read_json         6 6
polars read_ndjson       refused: ComputeError
polars column            refused: TypeError
DataFusion read_json     6 6
DataFusion read_csv      refused: Exception
fastparquet, objects     6 6
pandas read_json         6.25 6.75
END
