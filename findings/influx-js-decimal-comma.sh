#!/bin/sh
# InfluxDB's client 1.35.0 (npm): a reading "6,25" is stored as 6, and -5.7 in a field of whole numbers as -6.
#
# `floatField` and `intField` of a Point take texts as JavaScript does: as far as they are a number. A log with decimal
# commas loses its decimals, a mark of doubt behind a reading is dropped, and "12:30" is 12. `intField` rounds down, so
# that 1.9 is 1 and -5.7 is -6: a position around 0 has an offset of half a count. A stamp of float seconds is cut and
# stored as nanoseconds of 1970. No message; NaN and infinity alone raise. Convert with `Number`, which gives NaN for
# such texts, and round first.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . @influxdata/influxdb-client@1.35.0
cat >run.cjs <<'END'
const { Point } = require("@influxdata/influxdb-client");

const lines = {
  '"6.25"': (point) => point.floatField("p1", "6.25"),
  '"6,25"': (point) => point.floatField("p1", "6,25"),
  '"6.25?"': (point) => point.floatField("p1", "6.25?"),
  '"12:30"': (point) => point.floatField("p1", "12:30"),
  "1.9, whole": (point) => point.intField("x", 1.9),
  "-5.7, whole": (point) => point.intField("x", -5.7),
  '"12.9 mm", whole': (point) => point.intField("x", "12.9 mm"),
  NaN: (point) => point.floatField("p1", NaN),
};
for (const [what, fill] of Object.entries(lines)) {
  const point = new Point("axis").timestamp(0);
  try {
    console.log(`${what}:`, fill(point).toLineProtocol());
  } catch (error) {
    console.log(`${what}: ${error.message}`);
  }
}
console.log("stamp 1767323045.0005:", new Point("axis").intField("x", 1).timestamp(1767323045.0005).toLineProtocol());
END
node run.cjs | tee seen
diff - seen <<'END'
"6.25": axis p1=6.25 0
"6,25": axis p1=6 0
"6.25?": axis p1=6.25 0
"12:30": axis p1=12 0
1.9, whole: axis x=1i 0
-5.7, whole: axis x=-6i 0
"12.9 mm", whole: axis x=12i 0
NaN: invalid float value for field 'p1': NaN
stamp 1767323045.0005: axis x=1i 1767323045
END
