#!/bin/sh
# regression 2.0.1 (npm): the gain of a valve, 0.0004 kg/s per volt, is 0, and with it the whole line.
#
# Each coefficient is rounded to two decimals unless `precision` is stated, and predictions are made with the rounded
# ones: a leak of 0.001 kg/s and a gain of 0.0004 are both 0, the fit predicts 0 at all voltages, and its r2 is -0.62.
# In g/s the same data give the right line; a parabola loses its curvature, a power law of a flow its factor. A decay
# from 6.004 bar with 0.125 per second is one from 6 bar with 0.12. Nothing warns. State `precision: 12`, or fit in
# units that make numbers near 100.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . regression@2.0.1
cat >run.cjs <<'END'
const regression = require("regression");

const volts = Array.from({ length: 11 }, (_, place) => place - 5);
const line = (factor) => volts.map((u) => [u, factor * (0.001 + 0.0004 * u)]);
for (const [what, factor, options] of [["kg/s", 1, {}], ["g/s", 1000, {}], ["kg/s", 1, { precision: 12 }]]) {
  const { equation, r2, predict } = regression.linear(line(factor), options);
  console.log(`line in ${what} ${JSON.stringify(options)}: gain ${equation[0]}, leak ${equation[1]},`,
    `r2 ${r2}, at 5 V ${predict(5)[1]}`);
}
const curve = regression.polynomial(volts.map((u) => [u, 0.004 * u * u]), { order: 2 });
console.log("0.004 u^2:", curve.equation.join(", "));
const flow = [1e5, 2e5, 4e5].map((pressure) => [pressure, 3e-6 * Math.sqrt(pressure)]);
console.log("3e-6 p^0.5:", regression.power(flow).equation.join(", "));
const times = Array.from({ length: 50 }, (_, place) => place / 10);
const decay = regression.exponential(times.map((t) => [t, 6.004 * Math.exp(-0.125 * t)]));
console.log("6.004 exp(-0.125 t):", decay.equation.join(", "));
END
node run.cjs | tee seen
diff - seen <<'END'
line in kg/s {}: gain 0, leak 0, r2 -0.62, at 5 V 0
line in g/s {}: gain 0.4, leak 1, r2 1, at 5 V 3
line in kg/s {"precision":12}: gain 0.0004, leak 0.001, r2 1, at 5 V 0.003
0.004 u^2: 0, 0, 0
3e-6 p^0.5: 0, 0.5
6.004 exp(-0.125 t): 6, -0.12
END
