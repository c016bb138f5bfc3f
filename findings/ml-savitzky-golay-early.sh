#!/bin/sh
# ml-savitzky-golay 5.0.0 (npm): what it smooths stands half a window early.
#
# By default the filter gives values for whole windows alone: of 12 readings with a window of 5 it returns 8, and the
# first of them belongs to the third stamp. Beside the stamps of the recording a smoothed position is ahead by two
# samples, and so is its derivative. Padded (`pad: "pre"`) there are as many as readings, each in its place, and false
# at both ends. Nothing warns; savgol_filter of SciPy returns as many as it was given.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . ml-savitzky-golay@5.0.0
cat >run.cjs <<'END'
const found = require("ml-savitzky-golay");
const savitzkyGolay = found.default || found;

const place = [...Array(12).keys()].map((n) => 10 * n);
const options = { windowSize: 5, polynomial: 2, derivative: 0 };
const shown = (values) => [...values].map((value) => Math.round(10 * value) / 10).join(" ");
console.log("readings", shown(place));
console.log("smoothed", shown(savitzkyGolay(place, 1, options)));
console.log("padded  ", shown(savitzkyGolay(place, 1, { ...options, pad: "pre" })));
const square = place.map((value) => value * value);
console.log("slope   ", shown(savitzkyGolay(square, 1, { ...options, derivative: 1 })), "of", shown(place.map((value) => 20 * value)));
END
node run.cjs | tee seen
diff - seen <<'END'
readings 0 10 20 30 40 50 60 70 80 90 100 110
smoothed 20 30 40 50 60 70 80 90
padded   1.7 9.1 20 30 40 50 60 70 80 90 100.9 108.3
slope    400 600 800 1000 1200 1400 1600 1800 of 0 200 400 600 800 1000 1200 1400 1600 1800 2000 2200
END
