#!/bin/sh
# Day.js 1.11.23 (npm): a stamp of 5.5 s is 5.005 s, and 5.25 s is 5.025 s.
#
# The digits after the point are taken for a number of milliseconds: `.5` is 5 ms, `.25` is 25 ms, and `.05` is 5 ms
# too. A logger that drops trailing zeros so has a clock that jumps back: 5.4, 5.45, 5.5 become 5.004, 5.045, 5.005.
# With a `Z` at the end the same digits go another way and are right. Luxon, date-fns and `Date` are right. Nothing
# warns. Write three digits, or the zone.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . dayjs@1.11.23 luxon@3.7.2 date-fns@4.4.0
cat >run.cjs <<'END'
const dayjs = require("dayjs");
const { DateTime } = require("luxon");
const { parseISO } = require("date-fns");

const readers = {
  "Day.js": (text) => dayjs(text).valueOf(),
  Luxon: (text) => DateTime.fromISO(text).toMillis(),
  "date-fns": (text) => parseISO(text).valueOf(),
  Date: (text) => new Date(text).valueOf(),
};
for (const tail of ["5.4", "5.45", "5.5", "5.500", "5.05", "5.5Z"]) {
  const text = `2026-01-02T03:04:0${tail}`;
  const seconds = (reader) => ((reader(text) % 60000) / 1000).toFixed(3);
  console.log(text.padEnd(25), Object.entries(readers).map(([name, reader]) => `${name} ${seconds(reader)}`).join("  "));
}
END
TZ=UTC node run.cjs | tee seen
diff - seen <<'END'
2026-01-02T03:04:05.4     Day.js 5.004  Luxon 5.400  date-fns 5.400  Date 5.400
2026-01-02T03:04:05.45    Day.js 5.045  Luxon 5.450  date-fns 5.450  Date 5.450
2026-01-02T03:04:05.5     Day.js 5.005  Luxon 5.500  date-fns 5.500  Date 5.500
2026-01-02T03:04:05.500   Day.js 5.500  Luxon 5.500  date-fns 5.500  Date 5.500
2026-01-02T03:04:05.05    Day.js 5.005  Luxon 5.050  date-fns 5.050  Date 5.050
2026-01-02T03:04:05.5Z    Day.js 5.500  Luxon 5.500  date-fns 5.500  Date 5.500
END
