#!/bin/sh
# fourier-transform 2.5.0 (npm): a pressure of 6 bar that swings by 1 bar has a mean of 12 bar in its spectrum.
#
# The magnitudes are those of a spectrum with one side: each bin is twice its share, so that a swing of 1 bar is 1. The first bin, the mean,
# has no other side, and is doubled with the rest. The highest frequency, half the rate,
# is left out. fft.js 4.0.4, scaled by hand, is beside it. Halve the first bin.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . fourier-transform@2.5.0 fft.js@4.0.4
cat >run.cjs <<'END'
const FFT = require("fft.js");

(async () => {
  const { default: fft } = await import("fourier-transform");
  const N = 1024;
  for (const [mean, swing, cycles] of [[6, 1, 10], [0, 1, 10], [6, 0, 10], [0, 1, N / 2]]) {
    const p = Array.from({ length: N }, (_, k) => mean + swing * Math.cos((2 * Math.PI * cycles * k) / N));
    const found = fft(p);
    const both = new FFT(N);
    const out = both.createComplexArray();
    both.realTransform(out, p);
    const size = (k) => (Math.hypot(out[2 * k], out[2 * k + 1]) / N) * (k === 0 || k === N / 2 ? 1 : 2);
    const show = (value) => (value === undefined ? "none" : value.toFixed(2));
    console.log(`mean ${mean}, swing ${swing} at ${cycles} cycles: fourier-transform ${show(found[0])} and ${show(found[cycles])}, fft.js ${show(size(0))} and ${show(size(cycles))}`);
  }
})();
END
node run.cjs | tee seen
diff - seen <<'END'
mean 6, swing 1 at 10 cycles: fourier-transform 12.00 and 1.00, fft.js 6.00 and 1.00
mean 0, swing 1 at 10 cycles: fourier-transform 0.00 and 1.00, fft.js 0.00 and 1.00
mean 6, swing 0 at 10 cycles: fourier-transform 12.00 and 0.00, fft.js 6.00 and 0.00
mean 0, swing 1 at 512 cycles: fourier-transform 0.00 and none, fft.js 0.00 and 1.00
END
