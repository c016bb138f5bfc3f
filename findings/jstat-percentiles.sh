#!/bin/sh
# jStat 1.9.6 (npm): the median of ten readings is 5.5, or 5; their 95th percentile is 9, or 10; d3 and simple-statistics say 9.55.
#
# The readings are 1 to 10. `percentile` puts a line between two readings, as d3, just-percentile and NumPy do, but not in the last interval,
# where it hands over the reading below: what is beyond nine of ten is the ninth. `quantiles` has another rule (10), and `quartiles`
# takes readings as they are, so that its middle one is not `median`. A limit taken from one is broken by the other. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . jstat@1.9.6 simple-statistics@7.12.1 d3-array@3.2.5
cat >run.cjs <<'END'
const { jStat } = require("jstat");
const simple = require("simple-statistics");

(async () => {
  const d3 = await import("d3-array");
  const readings = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10];
  for (const share of [0.25, 0.5, 0.9, 0.95, 1]) {
    const found = [jStat.percentile(readings, share), jStat.quantiles(readings, [share])[0], simple.quantile(readings, share), d3.quantile(readings, share)];
    console.log(`${share}: jStat percentile ${found[0].toFixed(2)}, quantiles ${found[1].toFixed(2)}; simple-statistics ${found[2].toFixed(2)}; d3 ${found[3].toFixed(2)}`);
  }
  console.log(`jStat quartiles ${jStat.quartiles(readings).join(" ")}, median ${jStat.median(readings)}`);
})();
END
node run.cjs | tee seen
diff - seen <<'END'
0.25: jStat percentile 3.25, quantiles 2.94; simple-statistics 3.25; d3 3.25
0.5: jStat percentile 5.50, quantiles 5.50; simple-statistics 5.50; d3 5.50
0.9: jStat percentile 9.00, quantiles 9.60; simple-statistics 9.10; d3 9.10
0.95: jStat percentile 9.00, quantiles 10.00; simple-statistics 9.55; d3 9.55
1: jStat percentile 10.00, quantiles 10.00; simple-statistics 10.00; d3 10.00
jStat quartiles 3 5 8, median 5.5
END
