#!/bin/sh
# moving-averages 4.0.6 (npm): of readings of 6 bar with one missing, three means in a row are 4 bar.
#
# `ma` over three readings: NaN counts as 0 in the sum and as a reading in the number, so that a gap is a dip to two
# thirds of the pressure, and no gap any longer; by weights, in `wma`, it is 3, 4 and 5 bar. A first reading that is
# missing is none, and leaves no trace. `sma`, `ema` and `dma` pass over it; `sma` begins with a mean of 0. Nothing
# warns. Drop missing readings first, or fill them.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . moving-averages@4.0.6
cat >run.mjs <<'END'
import { dma, ema, ma, sma, wma } from "moving-averages";

const digits = (value) => (value === undefined ? "-" : Number(value.toFixed(2)));
const shown = (values) => Array.from(values, digits).join(" ");
for (const place of [0, 1, 4]) {
  const readings = Array.from({ length: 10 }, (_, at) => (at === place ? NaN : 6));
  console.log(`NaN at ${place}, ma of 3: ${shown(ma(readings, 3))}`);
}
const readings = [6, 6, 6, 6, NaN, 6, 6, 6, 6, 6];
for (const [name, smooth] of Object.entries({ sma, ema, wma })) console.log(`${name}: ${shown(smooth(readings, 3))}`);
console.log(`dma: ${shown(dma(readings, 0.5))}`);
END
node run.mjs | tee seen
diff - seen <<'END'
NaN at 0, ma of 3: - - - 6 6 6 6 6 6 6
NaN at 1, ma of 3: - - - 4 6 6 6 6 6 6
NaN at 4, ma of 3: - - 6 6 4 4 4 6 6 6
sma: 0 6 6 6 6 6 6 6 6 6
ema: 6 6 6 6 6 6 6 6 6 6
wma: - - 6 6 3 4 5 6 6 6
dma: 6 6 6 6 6 6 6 6 6 6
END
