#!/bin/sh
# advanced-pid 0.0.8: the faster the filter of the derivative, the less derivative: at a fifth of the period it has gone.
#
# An error that grows by 1 a second, sampled each 10 ms, through a PID with a derivative gain of 1 and nothing else: the
# output should tend to 1. With a filter of 100 ms it is 0.95, of 10 ms 0.58, of 3 ms 0.12 and of 1 ms 0.0005. The step of
# an error is taken as made at the sample before, and has decayed by the time of the output. So a servo axis whose damping
# comes from the derivative has less of it the less it is filtered, and none where the filter is off (0). The help calls
# Tf the filter's time constant, and no more. Choose a filter of ten periods or more, or differentiate yourself.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile advanced-pid==0.0.8 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
from advanced_pid import PID

period = 0.01
for filtered in (0.3, 0.1, 0.03, 0.01, 0.003, 0.001, 0.0):
    controller = PID(Kp=0.0, Ki=0.0, Kd=1.0, Tf=filtered)
    outputs = [controller(step * period, step * period) for step in range(1000)]
    print(f"filter of {filtered * 1000:3.0f} ms: derivative {outputs[-1]:.4f}")
END
diff - seen <<'END'
filter of 300 ms: derivative 0.9834
filter of 100 ms: derivative 0.9508
filter of  30 ms: derivative 0.8426
filter of  10 ms: derivative 0.5820
filter of   3 ms: derivative 0.1233
filter of   1 ms: derivative 0.0005
filter of   0 ms: derivative 0.0000
END
