#!/bin/sh
# unitmath 0.8.8 (npm): 25 degC less 20 degC is -268.15 degC, and twice 20 degC is 313.15 degC.
#
# Each temperature is a point on the kelvin scale, and so is each result: the warming of a chamber by 5 K is shown as -268.15 degC, and an
# error in degC is another one in K. 20 degC times 2, or plus itself, is 586.3 K, shown as 313.15 degC, without an error. The mean of two and
# the work of a gas constant are right. A product of R and 20 degC is 84134 "J degC / kg K", which only the same in kelvins
# shortens. Pressures and flows are right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . unitmath@0.8.8
cat >run.mjs <<'END'
import unit from "unitmath";

const warm = unit("25 degC");
const cold = unit("20 degC");
console.log("25 degC - 20 degC:", warm.sub(cold).toString(), "=", warm.sub(cold).to("K").toString());
console.log("20 degC x 2:", cold.mul(2).toString(), "| 20 degC + 20 degC:", cold.add(cold).toString());
console.log("mean of 20 and 25 degC:", cold.add(warm).div(2).toString());
console.log("5 K in degC:", unit("5 K").to("degC").toString());
console.log("R T:", unit("287 J / kg K").mul(cold).toString(), "|", unit("287 J / kg K").mul("293.15 K").toString());
console.log("1 bar:", unit("1 bar").to("Pa").toString(), "| 1 l/min:", unit("1 l/min").to("m^3/s").toString());
END
node run.mjs | tee seen
diff - seen <<'END'
25 degC - 20 degC: -268.15 degC = 5 K
20 degC x 2: 313.15 degC | 20 degC + 20 degC: 313.15 degC
mean of 20 and 25 degC: 22.5 degC
5 K in degC: -268.15 degC
R T: 84134.05 J degC / kg K | 84134.05 J / kg
1 bar: 100000 Pa | 1 l/min: 0.0000166666666666667 m^3 / s
END
