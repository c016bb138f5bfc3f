#!/bin/sh
# hyparquet 1.33.0 (npm): a Parquet recording of 4 kHz has four rows in each stamp, and durations lose their unit.
#
# Stamps of Parquet become `Date`, which counts whole milliseconds; their microseconds and nanoseconds are dropped, so
# that the clock of a loop of 4 kHz stands still for four rows, and rates found from it are 0 or infinite. Durations
# come as bare numbers in the unit of the file, whatever it is. In apache-arrow 21.2.0 stamps are right, as milliseconds
# with fractions; durations are as bare, and a decimal of 6.25 is 625 when shown: its scale stands only in the type.
# Nothing warns. Write the time as seconds, a float.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . hyparquet@1.33.0 apache-arrow@21.2.0
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pyarrow==26.0.1 numpy==2.4.6
v/bin/python -W ignore - <<'END'
from decimal import Decimal

import pyarrow as pa
import pyarrow.parquet

start, rows = 1_767_323_045_000_000, range(8)
table = pa.table(
    {
        "stamp": pa.array([start + 250 * row for row in rows], pa.timestamp("us")),
        "since_us": pa.array([250 * row for row in rows], pa.duration("us")),
        "since_ms": pa.array([row for row in rows], pa.duration("ms")),
        "p1": pa.array([Decimal("6.25")] * 8, pa.decimal128(10, 2)),
    }
)
pyarrow.parquet.write_table(table, "log.parquet")
with pa.ipc.new_file("log.arrow", table.schema) as file:
    file.write_table(table)
END
cat >run.mjs <<'END'
import { readFileSync } from "fs";
import { tableFromIPC } from "apache-arrow";
import { parquetReadObjects } from "hyparquet";

const bytes = readFileSync("log.parquet");
const file = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
const parquet = await parquetReadObjects({ file });
const arrow = [...tableFromIPC(readFileSync("log.arrow"))];
for (const [name, rows] of [["hyparquet", parquet], ["apache-arrow", arrow]]) {
  console.log(`${name}, stamps in ms:`, rows.map(({ stamp }) => stamp - 1767323045000).join(" "));
  const { since_us, since_ms, p1 } = rows[5];
  console.log(`${name}, 1250 us: ${since_us}, 5 ms: ${since_ms}, 6.25: ${p1}`);
}
END
node run.mjs | tee seen
diff - seen <<'END'
hyparquet, stamps in ms: 0 0 0 0 1 1 1 1
hyparquet, 1250 us: 1250, 5 ms: 5, 6.25: 6.25
apache-arrow, stamps in ms: 0 0.25 0.5 0.75 1 1.25 1.5 1.75
apache-arrow, 1250 us: 1250, 5 ms: 5, 6.25: 625
END
