#!/bin/sh
# Papa Parse 5.7.1 (npm): a column of signed numbers is half text, and stamps of nanoseconds are text.
#
# With `dynamicTyping` "-0.50" is a number and "+0.50" stays a text, so that a velocity that a logger writes with its
# sign always is numbers one way and texts the other: a sum puts them behind one another. Whole numbers above 2^53,
# such as nanoseconds since 1970, stay texts as well. It cuts rows with semicolons at their decimal commas.
# Nothing warns (`errors` is empty). d3-dsv reads the sign.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . papaparse@5.7.1
cat >run.cjs <<'END'
const Papa = require("papaparse");

const rows = Papa.parse("t_ns,v\n1762000000000000001,+0.50\n1762000000010000001,-0.50\n1762000000020000001,+0.25", {
  header: true,
  dynamicTyping: true,
});
for (const row of rows.data) console.log(typeof row.t_ns, typeof row.v, row.v);
console.log("sum", rows.data.reduce((sum, row) => sum + row.v, 0), "errors", rows.errors.length);
const german = "0,00;1,013\n0,01;1,014\n0,02;1,015\n";
console.log("without names", Papa.parse(german).meta.delimiter, " with names", Papa.parse("t;p1\n" + german).meta.delimiter);
END
node run.cjs | tee seen
diff - seen <<'END'
string string +0.50
string number -0.5
string string +0.25
sum 0+0.50-0.5+0.25 errors 0
without names ,  with names ,
END
