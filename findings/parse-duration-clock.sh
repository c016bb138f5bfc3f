#!/bin/sh
# parse-duration 2.1.9 (npm): a dead time of "0,5 s" is 5 s, "1:30" 1.03 ms, and "10 min 5" has 5 seconds more.
#
# Times of a test, read from its settings. A comma is dropped, whatever stands behind it: 0,5 s are 5 s and 1,5 s are
# 15 s. A number without a unit counts milliseconds, and one behind another number the next smaller unit: 1:30 is 1 ms
# and 30 us, "10 min 5" ends with five seconds, and 0.02, meant as seconds, is 0.02 ms. 5 m are minutes, never metres.
# Nothing is refused that begins with a number; what has no known unit, as 6 bar, is null. Write seconds with a point
# and their unit.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . parse-duration@2.1.9
cat >run.mjs <<'END'
import parse from "parse-duration";

for (const text of ["0.5 s", "0,5 s", "1,5 s", "1:30", "0.02", "10 min 5", "5 m", "500 us", "1e-3 s", "6 bar"]) {
  console.log(`${text}: ${parse(text)} ms`);
}
END
node run.mjs | tee seen
diff - seen <<'END'
0.5 s: 500 ms
0,5 s: 5000 ms
1,5 s: 15000 ms
1:30: 1.03 ms
0.02: 0.02 ms
10 min 5: 605000 ms
5 m: 300000 ms
500 us: 0.5 ms
1e-3 s: 1 ms
6 bar: null ms
END
