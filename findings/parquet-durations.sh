#!/bin/sh
# fastparquet 2026.9.0, pyarrow 26.0.1, polars 2.1.0: one reader on, a clock of durations is times of day, or numbers.
#
# A clock of 0.5 ms, just below 24 h, and 25 h. fastparquet writes it as times of day: pyarrow gives 1 o'clock for 25
# h, polars nothing. Durations of polars and of pandas (by pyarrow) are read by fastparquet as whole numbers, 500000
# for 0.5 ms, with no unit. Each package reads its own right, and nothing warns. pneucli reads all three: times of day
# that pass midnight go on.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile fastparquet==2026.9.0 pyarrow==26.0.1 polars==2.1.0 pandas==3.0.6 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import fastparquet
import pandas as pd
import polars as pl
import pyarrow.parquet as pq

clock = pd.to_timedelta([0.0005, 86399.9995, 90000.0005], unit="s")
frame = pd.DataFrame({"time": clock})


def show(writer):
    print(f"{writer}, pyarrow:", *pq.read_table("log.parquet")["time"].to_pylist(), sep=" | ")
    print(f"{writer}, polars:", *pl.read_parquet("log.parquet")["time"], sep=" | ")
    print(f"{writer}, fastparquet:", *fastparquet.ParquetFile("log.parquet").to_pandas()["time"], sep=" | ")


fastparquet.write("log.parquet", frame)
show("fastparquet")
pl.from_pandas(frame).write_parquet("log.parquet")
show("polars")
frame.to_parquet("log.parquet", engine="pyarrow")
show("pandas by pyarrow")
END
diff - seen <<'END'
fastparquet, pyarrow: | 00:00:00.000500 | 23:59:59.999500 | 01:00:00.000500
fastparquet, polars: | 00:00:00.000500 | 23:59:59.999500 | None
fastparquet, fastparquet: | 0 days 00:00:00.000500 | 0 days 23:59:59.999500 | 1 days 01:00:00.000500
polars, pyarrow: | 0 days 00:00:00.000500 | 0 days 23:59:59.999500 | 1 days 01:00:00.000500
polars, polars: | 0:00:00.000500 | 23:59:59.999500 | 1 day, 1:00:00.000500
polars, fastparquet: | 500000 | 86399999500000 | 90000000500000
pandas by pyarrow, pyarrow: | 0 days 00:00:00.000500 | 0 days 23:59:59.999500 | 1 days 01:00:00.000500
pandas by pyarrow, polars: | 0:00:00.000500 | 23:59:59.999500 | 1 day, 1:00:00.000500
pandas by pyarrow, fastparquet: | 500000 | 86399999500000 | 90000000500000
END
