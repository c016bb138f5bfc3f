#!/bin/sh
# ml-regression-robust-polynomial 3.0.2 (npm): a fit of degree 1 is a constant, one of degree 2 a line.
#
# A flow over voltage, exact, no outlier. The degree is the number of coefficients, so that a valve's gain is 0 at
# degree 1, and a parabola needs degree 3; ml-regression-polynomial, of the same family, counts as everybody does. With
# a tenth of outliers the line of degree 2 is right. Which constant depends on a random choice, and is another in each
# run. Add one to the degree.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . ml-regression-robust-polynomial@3.0.2 ml-regression-polynomial@3.0.2
cat >run.mjs <<'END'
import { PolynomialRegression } from "ml-regression-polynomial";
import { RobustPolynomialRegression } from "ml-regression-robust-polynomial";

let state = 1;
Math.random = () => (state = (state * 16807) % 2147483647) / 2147483647;
const volts = Array.from({ length: 41 }, (_, place) => place / 4);
const flows = {
  line: volts.map((u) => 1 + 2 * u),
  "line, a tenth at 200": volts.map((u, place) => (place % 10 === 3 ? 200 : 1 + 2 * u)),
  parabola: volts.map((u) => 1 + 2 * u + 0.5 * u * u),
};
const shown = (fit) => fit.coefficients.map((value) => Number(value.toFixed(3)) + 0).join(", ");
for (const [name, flow] of Object.entries(flows)) {
  for (const degree of [1, 2, 3]) {
    const robust = new RobustPolynomialRegression(volts, flow, degree);
    const plain = new PolynomialRegression(volts, flow, degree);
    console.log(`${name}, degree ${degree}: robust ${shown(robust)}; plain ${shown(plain)}`);
  }
}
END
node run.mjs | tee seen
diff - seen <<'END'
line, degree 1: robust 7.5; plain 1, 2
line, degree 2: robust 1, 2; plain 1, 2, 0
line, degree 3: robust 1, 2, 0; plain 1, 2, 0, 0
line, a tenth at 200, degree 1: robust 15.5; plain 25.704, 0.767
line, a tenth at 200, degree 2: robust 1, 2; plain 22.722, 2.602, -0.184
line, a tenth at 200, degree 3: robust 1, 2, 0; plain 30.656, -7.551, 2.386, -0.171
parabola, degree 1: robust 12.781; plain -7.125, 7
parabola, degree 2: robust -4.25, 5.625; plain 1, 2, 0.5
parabola, degree 3: robust 1, 2, 0.5; plain 1, 2, 0.5, 0
END
