#!/bin/sh
# chem-units 1.6.0 (npm): 3 Pa are 3 bar, and 1 psi is 1 Pa: a unit that it does not know leaves the number as it is.
#
# Its pressures are called `pa`, `bar`, `kpa`, in small letters; `Pa`, psi or a slip of the key convert nothing, and the
# same number comes back as if it were done. With its own names a result has five decimals unless more are asked for, so
# that 0.4 Pa is 0 bar, and 6 Pa of a leak test 0.00006. Temperatures are right. Nothing raises or warns in any of
# these. Convert 1 first, and see that another number comes back.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . chem-units@1.6.0
cat >run.cjs <<'END'
const { convert } = require("chem-units");

const asked = [
  [3, "Pa", "bar"], [3, "pa", "bar"], [1, "psi", "pa"], [1, "bar", "PA"], [1, "bar", "pa"], [0.4, "pa", "bar"],
];
for (const [value, from, to] of asked) {
  console.log(`${value} ${from} in ${to}: ${convert("pressure", value, from, to)}`);
}
console.log("0.4 pa in bar, 9 decimals:", convert("pressure", 0.4, "pa", "bar", 9));
console.log("20 C in K:", convert("temperature", 20, "C", "K"), "| 20 c in k:", convert("temperature", 20, "c", "k"));
END
node run.cjs | tee seen
diff - seen <<'END'
3 Pa in bar: 3
3 pa in bar: 0.00003
1 psi in pa: 1
1 bar in PA: 1
1 bar in pa: 100000
0.4 pa in bar: 0
0.4 pa in bar, 9 decimals: 0.000004
20 C in K: 293.15 | 20 c in k: 20
END
