#!/bin/sh
# SheetJS 0.18.5, csv-parse 7.0.3 (npm): a 5/3 valve with a port of 1/8 is a 3 May and an 8 January, both of 2001.
#
# A table of valves as CSV. SheetJS makes a number of the type, 37014 days since 1900, and hands that on; csv-parse
# with `cast_date` a date. 5/3, 5/2 and 3/2 are dates in both, as are ports of 1/8, 1/4 and 1/2 without their G, and a
# range of 1-2. A valve of 2x3/2 stays text, so that one column holds both. Nothing warns. State `raw: true` for
# SheetJS, and no `cast_date`; or write 5/3-way.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . xlsx@0.18.5 csv-parse@7.0.3
cat >run.mjs <<'END'
import { parse } from "csv-parse/sync";
import { createRequire } from "module";

const { read, utils } = createRequire(import.meta.url)("xlsx");

process.env.TZ = "UTC";
for (const cell of ["5/3", "5/2", "3/2", "2x3/2", "5/3-way", "1/8", "G1/8", "1-2"]) {
  const text = `valve\n${cell}\n`;
  const sheet = (options) => utils.sheet_to_json(read(text, { type: "string", ...options }).Sheets.Sheet1)[0].valve;
  const [{ valve }] = parse(text, { columns: true, cast: true, cast_date: true });
  const date = valve instanceof Date ? valve.toISOString().slice(0, 10) : valve;
  console.log(`${cell}: SheetJS ${sheet({})}, raw ${sheet({ raw: true })}, csv-parse ${date}`);
}
END
node run.mjs | tee seen
diff - seen <<'END'
5/3: SheetJS 37014, raw 5/3, csv-parse 2001-05-03
5/2: SheetJS 37013, raw 5/2, csv-parse 2001-05-02
3/2: SheetJS 36952, raw 3/2, csv-parse 2001-03-02
2x3/2: SheetJS 2x3/2, raw 2x3/2, csv-parse 2x3/2
5/3-way: SheetJS 5/3-way, raw 5/3-way, csv-parse 5/3-way
1/8: SheetJS 36899, raw 1/8, csv-parse 2001-01-08
G1/8: SheetJS G1/8, raw G1/8, csv-parse G1/8
1-2: SheetJS 36893, raw 1-2, csv-parse 2001-01-02
END
