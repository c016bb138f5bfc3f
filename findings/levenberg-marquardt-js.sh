#!/bin/sh
# ml-levenberg-marquardt 5.1.0 (npm): exact flows in kg/s give a wrong critical pressure ratio; the same flows in g/s give the right one.
#
# Sixty flows of a valve after ISO 6358 without any noise: conductance C, critical ratio b = 0.3, supply 6 bar; the
# fit begins at 2 C and b = 0.5. It stops where the sum of squares falls below `errorTolerance`, which is 0.01 of whatever unit: in kg/s it ends
# after a few steps. For C = 0.1 dm3/(s bar) b comes out as 0.49, its start nearly; for 1 dm3/(s bar) as 0.29. The numbers
# look like an answer, and `iterations` is 3 or 4 of 100. In g/s, or with `errorTolerance: 1e-18`, b is 0.300.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . ml-levenberg-marquardt@5.1.0
cat >run.mjs <<'END'
import { levenbergMarquardt } from "ml-levenberg-marquardt";

const psi = (ratio, b) => (ratio < b ? 1 : Math.sqrt(Math.max(0, 1 - ((ratio - b) / (1 - b)) ** 2)));
const ratios = Array.from({ length: 60 }, (_, row) => 0.1 + 0.015 * row);

function fitted(conductance, factor, options = {}) {
  const flow = ([c, b]) => (ratio) => factor * c * 1e-8 * 6e5 * 1.185 * psi(ratio, b);
  const data = { x: ratios, y: ratios.map(flow([conductance, 0.3])) };
  const found = levenbergMarquardt(data, flow, { initialValues: [2 * conductance, 0.5], ...options });
  const [c, b] = found.parameterValues;
  return `C ${(c / conductance).toFixed(2)} times the true one, b ${b.toFixed(2)}, ${found.iterations} iterations`;
}

for (const conductance of [1, 0.3, 0.1]) {
  console.log(`C = ${conductance}, kg/s:`, fitted(conductance, 1));
  console.log(`C = ${conductance}, g/s:`, fitted(conductance, 1e3));
}
console.log("C = 0.1, kg/s, errorTolerance 1e-18:", fitted(0.1, 1, { errorTolerance: 1e-18 }));
END
node run.mjs | tee seen
diff - seen <<'END'
C = 1, kg/s: C 1.00 times the true one, b 0.29, 4 iterations
C = 1, g/s: C 1.00 times the true one, b 0.30, 6 iterations
C = 0.3, kg/s: C 0.98 times the true one, b 0.38, 4 iterations
C = 0.3, g/s: C 1.00 times the true one, b 0.30, 5 iterations
C = 0.1, kg/s: C 0.97 times the true one, b 0.49, 3 iterations
C = 0.1, g/s: C 1.00 times the true one, b 0.30, 5 iterations
C = 0.1, kg/s, errorTolerance 1e-18: C 1.00 times the true one, b 0.30, 12 iterations
END
