#!/bin/sh
# lodash 4.18.1, jStat 1.9.6, ml-array-mean 2.0.0 (npm): the mean of 6, null and 6 is 4; that of 6, "6" and 6 is 222.
#
# Readings from JSON, where a missing one is null and one that a form stored is text. The sum takes null for 0 and
# counts it, so that a pressure of 6 bar has a mean of 4; its least reading is null in jStat and simple-statistics,
# whose mean is NaN. After a text all digits are joined, "666", and divided by three; an empty cell makes 22 of 66.
# d3-array and stats-lite leave what is missing out and read "6" as 6, though an empty cell is 0 in d3-array and
# mathjs; mathjs refuses null. Nothing warns. Keep what is a finite number before any mean.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . lodash@4.18.1 jstat@1.9.6 ml-array-mean@2.0.0 simple-statistics@7.12.1 d3-array@3.2.5 stats-lite@2.2.0 mathjs@15.2.0
cat >run.mjs <<'END'
import { createRequire } from "module";
import * as d3 from "d3-array";
import * as ml from "ml-array-mean";
import * as simple from "simple-statistics";

const require = createRequire(import.meta.url);
const lodash = require("lodash");
const mathjs = require("mathjs");
const stats = require("stats-lite");
const { jStat } = require("jstat");

const means = {
  lodash: lodash.mean,
  jStat: jStat.mean,
  "ml-array-mean": ml.default ?? ml.mean ?? ml.xMean,
  "simple-statistics": simple.mean,
  "d3-array": d3.mean,
  "stats-lite": stats.mean,
  mathjs: mathjs.mean,
};
const least = { lodash: lodash.min, jStat: jStat.min, "simple-statistics": simple.min, "d3-array": d3.min };
const said = (ask, readings) => {
  try {
    return String(ask(readings));
  } catch {
    return "refused";
  }
};
for (const readings of [[6, null, 6], [6, "6", 6], [6, "", 6]]) {
  for (const [what, asked] of [["mean", means], ["least", least]]) {
    const found = Object.entries(asked).map(([name, ask]) => `${name} ${said(ask, readings)}`);
    console.log(`${what} of ${JSON.stringify(readings)}: ${found.join(", ")}`);
  }
}
END
node run.mjs | tee seen
diff - seen <<'END'
mean of [6,null,6]: lodash 4, jStat 4, ml-array-mean 4, simple-statistics NaN, d3-array 6, stats-lite 6, mathjs refused
least of [6,null,6]: lodash 6, jStat null, simple-statistics null, d3-array 6
mean of [6,"6",6]: lodash 222, jStat 222, ml-array-mean 222, simple-statistics NaN, d3-array 6, stats-lite 6, mathjs 6
least of [6,"6",6]: lodash 6, jStat 6, simple-statistics 6, d3-array 6
mean of [6,"",6]: lodash 22, jStat 22, ml-array-mean 22, simple-statistics NaN, d3-array 4, stats-lite 6, mathjs 4
least of [6,"",6]: lodash , jStat , simple-statistics , d3-array 
END
