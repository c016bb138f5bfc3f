#!/bin/sh
# DuckDB 2.0.1, DataFusion 55.0.0, Polars 2.1.0, SQLite: 10-2^2 is 6 or 10, log(10, 100) 2 or 0.5, 6.25 % 1 0.25 or 0.
#
# A calibration in a query that moves from one engine to another. ^ is a power in DuckDB, an exclusive or in
# DataFusion, which goes after minus; the others refuse it. The base of a logarithm is the first number in three, the
# second in Polars. SQLite cuts both sides of % to whole numbers, so that the part behind the point is always 0. Counts
# divided by 2 lose their half in DataFusion and SQLite, and 1/0 is an infinity, a missing value or an error. Write
# power(), log10() and 2.0, and divide by log10 of the base.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile duckdb==2.0.1 datafusion==55.0.0 polars==2.1.0 pyarrow==26.0.1
v/bin/python -W ignore - <<'END' | tee seen
import sqlite3

import datafusion
import duckdb
import polars as pl

lite, duck, fusion = sqlite3.connect(":memory:"), duckdb.connect(), datafusion.SessionContext()
frames = pl.SQLContext({"log": pl.DataFrame({"one": [1]})})
engines = {
    "DuckDB": lambda query: duck.execute(query).fetchone()[0],
    "DataFusion": lambda query: next(iter(fusion.sql(query).to_pydict().values()))[0],
    "Polars": lambda query: frames.execute(f"{query} AS v FROM log", eager=True)["v"][0],
    "SQLite": lambda query: lite.execute(query).fetchone()[0],
}


def said(ask, query):
    try:
        value = ask(query)
    except Exception:
        return "refused"
    return "missing" if value is None else f"{float(value):.4g}"


for text in ("10-2^2", "2^3^2", "7/2", "6.25 % 1", "log(10, 100)", "log10(100)", "1/0", "sqrt(-1.0)", "-7 % 3"):
    print(f"{text}:", ", ".join(f"{name} {said(ask, f'SELECT {text}')}" for name, ask in engines.items()))
END
diff - seen <<'END'
10-2^2: DuckDB 6, DataFusion 10, Polars refused, SQLite refused
2^3^2: DuckDB 64, DataFusion 3, Polars refused, SQLite refused
7/2: DuckDB 3.5, DataFusion 3, Polars 3.5, SQLite 3
6.25 % 1: DuckDB 0.25, DataFusion 0.25, Polars 0.25, SQLite 0
log(10, 100): DuckDB 2, DataFusion 2, Polars 0.5, SQLite 2
log10(100): DuckDB 2, DataFusion 2, Polars 2, SQLite 2
1/0: DuckDB inf, DataFusion refused, Polars inf, SQLite missing
sqrt(-1.0): DuckDB nan, DataFusion refused, Polars nan, SQLite missing
-7 % 3: DuckDB -1, DataFusion -1, Polars -1, SQLite -1
END
