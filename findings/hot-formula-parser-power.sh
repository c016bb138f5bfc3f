#!/bin/sh
# hot-formula-parser 4.0.0 (npm): =10^-3*2 is 1e-6, =-A1^2 is -4 for 2, and =MOD(-1,6) is 1; sheets have 0.002, 4 and 5.
#
# Formulas of a calibration, taken from a sheet. After a power with a minus the rest of the product belongs to the
# exponent; a minus before a power is applied last, where a spreadsheet squares what is negative. ATAN2 takes y first,
# a sheet x; MOD of a negative angle is that of its size, and ROUND of -2.5 goes up. fast-formula-parser and
# HyperFormula agree with a sheet in all these, but INT of HyperFormula cuts: -0.3 turns are -0, with -0.3 beyond,
# where a sheet has -1. Nothing warns. Put powers into brackets, and compare with the values that the sheet stores.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . hot-formula-parser@4.0.0 fast-formula-parser@1.0.19 hyperformula@3.5.0
cat >run.mjs <<'END'
import { createRequire } from "module";

const require = createRequire(import.meta.url);
const { HyperFormula } = require("hyperformula");
const Fast = require("fast-formula-parser");
const { Parser } = require("hot-formula-parser");

const sheets = HyperFormula.buildEmpty({ licenseKey: "gpl-v3" });
sheets.addSheet("Sheet");
const cell = { sheet: "Sheet", row: 1, col: 1 };
const rows = [
  ["10^-3*2", 0.002],
  ["-2^2", 4],
  ["2^3^2", 64],
  ["2^-1^2", 0.25],
  ["MOD(-1,6)", 5],
  ["ATAN2(1,2)", 1.1071],
  ["ROUND(-2.5,0)", -3],
  ["INT(-0.3)", -1],
  ["6-3-2", 1],
];
for (const [formula, wanted] of rows) {
  const found = [new Parser().parse(formula).result, new Fast().parse(formula, cell)];
  found.push(sheets.calculateFormula(`=${formula}`, 0));
  const [hot, fast, hyper] = found.map((value) => Number(value.toPrecision(5)));
  console.log(`${formula}: sheet ${wanted}, hot ${hot}, fast ${fast}, HyperFormula ${hyper}`);
}
END
node run.mjs | tee seen
diff - seen <<'END'
10^-3*2: sheet 0.002, hot 0.000001, fast 0.002, HyperFormula 0.002
-2^2: sheet 4, hot -4, fast 4, HyperFormula 4
2^3^2: sheet 64, hot 64, fast 64, HyperFormula 64
2^-1^2: sheet 0.25, hot 0.5, fast 0.25, HyperFormula 0.25
MOD(-1,6): sheet 5, hot 1, fast 5, HyperFormula 5
ATAN2(1,2): sheet 1.1071, hot 0.46365, fast 1.1071, HyperFormula 1.1071
ROUND(-2.5,0): sheet -3, hot -2, fast -3, HyperFormula -3
INT(-0.3): sheet -1, hot -1, fast -1, HyperFormula 0
6-3-2: sheet 1, hot 1, fast 1, HyperFormula 1
END
