#!/bin/sh
# basic-pid 0.2.7: the period that is stated is not used, so that a loop of 1 kHz integrates ten times faster than one of 100 Hz.
#
# An integral gain of 1 and an error of 1 for a second should make 1. With `setTimeinc(dt)` at 10 Hz, 100 Hz and 1 kHz the
# output is 9.5, 99.5 and 999.5: each call adds the error as it is, and the derivative is a difference of calls.
# `getTimeinc` returns what was set. In the mode that is on by default the output is the change of one call, to be summed
# outside. Multiply the integral gain by the period, and divide the derivative's by it.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile basic-pid==0.2.7
v/bin/python -W ignore - <<'END' | tee seen
from basicpid import BasicPid

for period in (0.1, 0.01, 0.001):
    for gains, what in (((0, 1, 0), "integral of 1 over 1 s"), ((0, 0, 1), "derivative of 1 per s")):
        controller = BasicPid()
        controller.setGains(*gains)
        controller.setTimeinc(period)
        controller.setIntegrateModeOn()
        for step in range(round(1 / period)):
            output = controller.getPid(1.0 if gains[1] else step * period, 0.0)
        print(f"period {controller.getTimeinc():5g} s, {what}: {output:.4g}")
END
diff - seen <<'END'
period   0.1 s, integral of 1 over 1 s: 9.5
period   0.1 s, derivative of 1 per s: 0.1
period  0.01 s, integral of 1 over 1 s: 99.5
period  0.01 s, derivative of 1 per s: 0.01
period 0.001 s, integral of 1 over 1 s: 999.5
period 0.001 s, derivative of 1 per s: 0.001
END
