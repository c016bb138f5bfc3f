#!/bin/sh
# exponential-regression 1.0.2 (npm): a time constant of 2 s, read each second without noise, is 2.04 s; each 4 s, 2.63 s.
#
# a + b exp(c t) is found in one step, from sums of trapezoids under the readings, so that their error is in the result: it grows with the
# square of the period over the time constant, and noise has no part in it. Least squares (`curve_fit` does so in Python,
# ml-levenberg-marquardt here) finds 2 s from the same readings. A clock that begins at 1000 s gives NaN for a and b beside the same
# time constant. Nothing warns. Ten readings to a time constant keep the error at 1 part in 1000.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . exponential-regression@1.0.2 ml-levenberg-marquardt@5.1.0
cat >run.cjs <<'END'
const { ExpReg } = require("exponential-regression");

(async () => {
  const { levenbergMarquardt } = await import("ml-levenberg-marquardt");
  for (const [start, period] of [[0, 0.2], [0, 1], [0, 2], [0, 4], [1000, 1]]) {
    const x = Array.from({ length: 11 }, (_, k) => start + k * period);
    const y = x.map((time) => 1 + 2 * Math.exp(-(time - start) / 2));
    const { a, c } = ExpReg.solve(x, y);
    const model = ([level, fall, tau]) => (time) => level + fall * Math.exp(-(time - start) / tau);
    const fit = levenbergMarquardt({ x, y }, model, { initialValues: [0.5, 1.5, 1], maxIterations: 500, errorTolerance: 1e-12 });
    console.log(`from ${start} s, each ${period} s: time constant ${(-1 / c).toFixed(3)} s, level ${a.toFixed(3)}; least squares ${fit.parameterValues[2].toFixed(3)} s, ${fit.parameterValues[0].toFixed(3)}`);
  }
})();
END
node run.cjs | tee seen
diff - seen <<'END'
from 0 s, each 0.2 s: time constant 2.002 s, level 0.999; least squares 2.000 s, 1.000
from 0 s, each 1 s: time constant 2.041 s, level 0.993; least squares 2.000 s, 1.000
from 0 s, each 2 s: time constant 2.164 s, level 0.988; least squares 2.000 s, 1.000
from 0 s, each 4 s: time constant 2.626 s, level 0.979; least squares 2.000 s, 1.000
from 1000 s, each 1 s: time constant 2.041 s, level NaN; least squares 2.000 s, 1.000
END
