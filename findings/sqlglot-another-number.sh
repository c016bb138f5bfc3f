#!/bin/sh
# sqlglot 30.30.0: a query for SQLite, translated for DuckDB, gives 3.5 for 3; log(100) becomes a natural one in MySQL.
#
# Counts by 2 are whole in SQLite and PostgreSQL; what sqlglot writes for DuckDB divides them with a fraction, though
# the way back has a cast. % of SQLite cuts to whole numbers, and is left as it is. LOG of one number is decimal in
# PostgreSQL, DuckDB and SQLite, natural in MySQL, ClickHouse, Spark and T-SQL: from these it is made LN, to these it
# stays LOG. Powers are right, and an exclusive or of MySQL too. Nothing warns, `unsupported_level` raised or not.
# Write LN, LOG10 and casts.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile sqlglot==30.30.0 duckdb==2.0.1
v/bin/python -W ignore - <<'END' | tee seen
import sqlite3

import duckdb
import sqlglot

lite, duck = sqlite3.connect(":memory:"), duckdb.connect()
for text in ("7/2", "(3+4)/2", "6.25 % 1", "7/2.0"):
    query = f"SELECT {text}"
    (made,) = sqlglot.transpile(query, read="sqlite", write="duckdb", unsupported_level=sqlglot.ErrorLevel.RAISE)
    before, after = lite.execute(query).fetchone()[0], duck.execute(made).fetchone()[0]
    print(f"{text} in SQLite {float(before):g}; in DuckDB {made}: {float(after):g}")
for source, targets in (
    ("duckdb", ("mysql", "clickhouse", "spark", "tsql")),
    ("mysql", ("duckdb", "postgres")),
    ("spark", ("duckdb",)),
):
    for target in targets:
        made = sqlglot.transpile("SELECT LOG(100)", read=source, write=target)[0]
        print(f"SELECT LOG(100) of {source} for {target}: {made}")
print("10-2^2 of duckdb for mysql:", sqlglot.transpile("SELECT 10-2^2", read="duckdb", write="mysql")[0])
END
diff - seen <<'END'
7/2 in SQLite 3; in DuckDB SELECT 7 / NULLIF(2, 0): 3.5
(3+4)/2 in SQLite 3; in DuckDB SELECT (3 + 4) / NULLIF(2, 0): 3.5
6.25 % 1 in SQLite 0; in DuckDB SELECT 6.25 % 1: 0.25
7/2.0 in SQLite 3.5; in DuckDB SELECT 7 / NULLIF(2.0, 0): 3.5
SELECT LOG(100) of duckdb for mysql: SELECT LOG(100)
SELECT LOG(100) of duckdb for clickhouse: SELECT LOG(100)
SELECT LOG(100) of duckdb for spark: SELECT LOG(100)
SELECT LOG(100) of duckdb for tsql: SELECT LOG(100)
SELECT LOG(100) of mysql for duckdb: SELECT LN(100)
SELECT LOG(100) of mysql for postgres: SELECT LN(100)
SELECT LOG(100) of spark for duckdb: SELECT LN(100)
10-2^2 of duckdb for mysql: SELECT 10 - POWER(2, 2)
END
