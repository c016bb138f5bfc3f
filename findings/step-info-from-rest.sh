#!/bin/sh
# control 0.10.2: `step_info` of a recorded step counts from zero, so that one step to 6 bar has two overshoots.
#
# One second-order step with an overshoot of 30 %, a rise of 94 ms and a settling of 0.73 s, is recorded three times: from
# 0 to 1, from 5 to 6, and from 6 to 5 bar. `step_info(data, time)` has no argument for where the step began. From 5 to 6
# bar it reports a rise of 71 ms, an overshoot of 5 % and a settling of 0.32 s, since 10 % and 2 % are of 6 bar; from 6 to
# 5 bar a rise of 0, an overshoot of 20 % and a peak at the very start. Nothing warns. Its help says "from 10 % to 90 % of
# the steady-state value". Subtract the start first, and turn a fall over.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile control==0.10.2 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import control
import numpy as np

time = np.linspace(0, 3, 3001)
damping, rate = 0.358, 15.0
fast = rate * np.sqrt(1 - damping**2)
step = 1 - np.exp(-damping * rate * time) * (np.cos(fast * time) + damping * rate / fast * np.sin(fast * time))
for what, pressure in (("0 to 1", step), ("5 to 6", 5 + step), ("6 to 5", 6 - step), ("6 to 5, turned", -(6 - step) + 6)):
    found = control.step_info(pressure, time)
    rise, settled, peak = (found[key] for key in ("RiseTime", "SettlingTime", "PeakTime"))
    print(f"{what:14s} rise {rise:.3f} s, settling {settled:.3f} s, overshoot {found['Overshoot']:.1f} %, peak at {peak:.3f} s")
END
diff - seen <<'END'
0 to 1         rise 0.094 s, settling 0.727 s, overshoot 30.0 %, peak at 0.224 s
5 to 6         rise 0.071 s, settling 0.316 s, overshoot 5.0 %, peak at 0.224 s
6 to 5         rise 0.000 s, settling 0.323 s, overshoot 20.0 %, peak at 0.000 s
6 to 5, turned rise 0.094 s, settling 0.727 s, overshoot 30.0 %, peak at 0.224 s
END
