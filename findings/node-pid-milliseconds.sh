#!/bin/sh
# node-pid-controller 1.0.1 (npm): two updates in one millisecond count as a second, so that a loop of 2 kHz integrates 500 times too fast.
#
# A controller with an integral of 1/s and a constant error of 1, for 0.1 s of a clock that is set here. Without a stated `dt` the
# controller takes the time from whole milliseconds, and a time of 0 is replaced by 1 s, at the first call and wherever two calls
# fall into one millisecond. At 500 Hz the integral is 1.1 instead of 0.1; at 2 kHz it is 101. With `dt` stated it is right.
# After a jump of the target, the derivative kicks with error over dt.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . node-pid-controller@1.0.1
cat >run.mjs <<'END'
import Controller from "node-pid-controller";

let now = 1_800_000_000_000;
Date.now = () => Math.floor(now);

function integral(rate, options = {}) {
  const controller = new Controller({ k_p: 0, k_i: 1, k_d: 0, ...options });
  controller.setTarget(1);
  let output = 0;
  for (let call = 0; call < 0.1 * rate; call++) {
    output = controller.update(0);
    now += 1000 / rate;
  }
  return output.toFixed(2);
}

for (const rate of [500, 1000, 2000, 4000]) {
  console.log(`${rate} Hz, 0.1 s of an error of 1: ${integral(rate)}, with dt stated ${integral(rate, { dt: 1 / rate })}`);
}
const kicked = new Controller({ k_p: 0, k_i: 0, k_d: 0.01, dt: 0.001 });
kicked.update(0);
kicked.setTarget(1);
console.log("derivative of 10 ms after a jump of the target:", kicked.update(0), "then", kicked.update(0));
END
node run.mjs | tee seen
diff - seen <<'END'
500 Hz, 0.1 s of an error of 1: 1.10, with dt stated 0.10
1000 Hz, 0.1 s of an error of 1: 1.10, with dt stated 0.10
2000 Hz, 0.1 s of an error of 1: 101.10, with dt stated 0.10
4000 Hz, 0.1 s of an error of 1: 301.10, with dt stated 0.10
derivative of 10 ms after a jump of the target: 10 then 0
END
