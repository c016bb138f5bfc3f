#!/bin/sh
# math-expression-evaluator 2.0.7, nerdamer 1.1.13, algebrite 1.4.0 (npm): 6e5 is 81.5; 10^-3*2 is 1e-6.
#
# Formulas of a calibration, evaluated as text. In math-expression-evaluator e is always Euler's number: 6e5 is 6 times
# e times 5, and 5.1e-9 is 5.1 e less 9, 4.86; log is decimal there, and natural in the others. nerdamer reads these
# right, but takes what follows a negative exponent into it, so that 10^-3*2 is 10^-6. algebrite makes 6 times an
# unknown e5 of it. mathjs has 600000 and 0.002. Nothing warns. Write 600000, and (10^(-3))*2.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . math-expression-evaluator@2.0.7 nerdamer@1.1.13 algebrite@1.4.0 mathjs@15.2.0
cat >run.mjs <<'END'
import { createRequire } from "module";

const require = createRequire(import.meta.url);
const algebrite = require("algebrite");
const mathjs = require("mathjs");
const Evaluator = require("math-expression-evaluator");
const nerdamer = require("nerdamer");

const packages = {
  "math-expression-evaluator": (text) => new Evaluator().eval(text).toPrecision(6),
  nerdamer: (text) => Number(nerdamer(text).evaluate().text("decimals")).toPrecision(6),
  algebrite: (text) => algebrite.run(text).split("\n")[0],
  mathjs: (text) => mathjs.evaluate(text).toPrecision(6),
};
const said = (ask, text) => {
  try {
    return ask(text);
  } catch {
    return "refused";
  }
};
for (const text of ["6e5", "5.1e-9", "1e-12*1e12", "10^-3*2", "10^(-3)*2", "log(100)", "2^3^2", "6-3-2"]) {
  console.log(`${text}:`, Object.entries(packages).map(([name, ask]) => `${name} ${said(ask, text)}`).join(", "));
}
END
node run.mjs | tee seen
diff - seen <<'END'
6e5: math-expression-evaluator 81.5485, nerdamer 600000, algebrite 6*e5, mathjs 600000
5.1e-9: math-expression-evaluator 4.86324, nerdamer 5.10000e-9, algebrite 0.000000..., mathjs 5.10000e-9
1e-12*1e12: math-expression-evaluator -388.714, nerdamer 1.00000, algebrite -12*e12+e, mathjs 1.00000
10^-3*2: math-expression-evaluator refused, nerdamer 0.00000100000, algebrite 10^- ? 3*2, mathjs 0.00200000
10^(-3)*2: math-expression-evaluator 0.00200000, nerdamer 0.00200000, algebrite 1/500, mathjs 0.00200000
log(100): math-expression-evaluator 2.00000, nerdamer 4.60517, algebrite log(100), mathjs 4.60517
2^3^2: math-expression-evaluator 64.0000, nerdamer 512.000, algebrite 512, mathjs 512.000
6-3-2: math-expression-evaluator 1.00000, nerdamer 1.00000, algebrite 1, mathjs 1.00000
END
