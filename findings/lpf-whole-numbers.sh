#!/bin/sh
# lpf 1.0.0 (npm): a smoothed pressure of 6.25 to 6.4 bar is 6 bar throughout, and a filter of ten samples takes 60.
#
# `smoothArray` rounds each result to a whole number, in the caller's own array: in bar, mm or V all is lost but the
# first. `next`, for one reading at a time, does not round, but smooths what it has smoothed before: each output goes
# through all that are in its buffer once more, so that a smoothing of 0.1, which should reach 63 % of a step in 10
# samples, takes 60, and an impulse returns as an echo each time the buffer is full. The length of the buffer, 10 unless
# set, changes the filter. Nothing warns. Write y += a * (x - y) by hand.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . lpf@1.0.0
cat >run.cjs <<'END'
const LPF = require("lpf");

LPF.smoothing = 0.5;
const pressure = [6.25, 6.31, 6.37, 6.4];
console.log("smoothArray of 6.25, 6.31, 6.37, 6.4:", LPF.smoothArray(pressure).join(" "), "| and then:", ...pressure);
function start(smoothing, size) {
  Object.assign(LPF, { smoothing, bufferMaxSize: size, buffer: [] });
  LPF.init(Array(size).fill(0));
}
for (const smoothing of [0.1, 0.2, 0.5]) {
  for (const size of [1, 10]) {
    start(smoothing, size);
    const response = Array.from({ length: 1000 }, () => LPF.next(1));
    const steps = response.findIndex((value) => value > 0.632) + 1;
    const should = Math.ceil(-1 / Math.log(1 - smoothing));
    console.log(`smoothing ${smoothing}, buffer of ${size}: 63 % of a step after ${steps} samples, should be ${should}`);
  }
}
start(0.1, 10);
const echo = [1, ...Array(11).fill(0)].map((value) => LPF.next(value).toFixed(4));
console.log("impulse, smoothing 0.1, buffer of 10:", echo.join(" "));
END
node run.cjs | tee seen
diff - seen <<'END'
smoothArray of 6.25, 6.31, 6.37, 6.4: 6.25 6 6 6 | and then: 6.25 6 6 6
smoothing 0.1, buffer of 1: 63 % of a step after 10 samples, should be 10
smoothing 0.1, buffer of 10: 63 % of a step after 60 samples, should be 10
smoothing 0.2, buffer of 1: 63 % of a step after 5 samples, should be 5
smoothing 0.2, buffer of 10: 63 % of a step after 19 samples, should be 5
smoothing 0.5, buffer of 1: 63 % of a step after 2 samples, should be 2
smoothing 0.5, buffer of 10: 63 % of a step after 3 samples, should be 2
impulse, smoothing 0.1, buffer of 10: 0.1000 0.0090 0.0089 0.0088 0.0087 0.0086 0.0086 0.0085 0.0084 0.0083 0.0396 0.0106
END
