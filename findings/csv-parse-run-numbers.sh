#!/bin/sh
# csv-parse 7.0.3 (npm): with `cast_date`, "run 7" is 1 July 2001, "axis 32" the year 2032, and 6,25 the 25th of June.
#
# What is no number is handed to the date parser of JavaScript, which drops words before a number: a run, a step or a
# valve from 1 to 12 is a month of 2001, from 13 to 31 it stays text, from 32 on it is a year. A reading with a decimal
# comma is a day. One column then holds dates, texts and numbers, and rows cannot be grouped by run. Stamps are right,
# which is what the option is for. Nothing warns. State `cast` as a function that knows the columns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . csv-parse@7.0.3
cat >run.mjs <<'END'
import { parse } from "csv-parse/sync";

process.env.TZ = "UTC";
const named = ["run 7", "step 12", "step 13", "axis 31", "axis 32", "valve 5", "p1 9"];
for (const cell of ["2026-01-02 03:04:05", ...named, "6.25", "6,25"]) {
  const rows = parse(`name\n${cell}\n`, { columns: true, cast: true, cast_date: true, delimiter: ";" });
  const found = rows[0].name;
  console.log(`${cell}:`, found instanceof Date ? `date ${found.toISOString()}` : `${typeof found} ${found}`);
}
END
node run.mjs | tee seen
diff - seen <<'END'
2026-01-02 03:04:05: date 2026-01-02T03:04:05.000Z
run 7: date 2001-07-01T00:00:00.000Z
step 12: date 2001-12-01T00:00:00.000Z
step 13: string step 13
axis 31: string axis 31
axis 32: date 2032-01-01T00:00:00.000Z
valve 5: date 2001-05-01T00:00:00.000Z
p1 9: string p1 9
6.25: number 6.25
6,25: date 2001-06-25T00:00:00.000Z
END
