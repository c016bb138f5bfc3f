#!/bin/sh
# interpolatepy 3.3.2: 300 mm take longer than 310 mm, the position steps back on its way, and a move of 20 mm ends at 40 mm.
#
# Limits of 1 m/s, 5 m/s2 and 50 m/s3. Where the speed is reached, `DoubleSTrajectory` is right. Where it is not, it uses half of
# the acceleration that is allowed, and its parts do not meet: in the midst the position steps back against
# the velocity that is handed out beside it. A move of 20 mm that begins at 0.9 m/s cannot stop in time; it goes on at a
# constant 0.9 m/s and ends at 40 mm. Nothing raises or warns. As a reference it makes a controller look at fault.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile interpolatepy==3.3.2 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from interpolatepy import DoubleSTrajectory, StateParams, TrajectoryBounds

for way, speed in ((0.5, 0), (0.31, 0), (0.3, 0), (0.1, 0), (0.02, 0.9)):
    move = DoubleSTrajectory(StateParams(q_0=0.0, q_1=way, v_0=speed, v_1=0.0), TrajectoryBounds(v_bound=1.0, a_bound=5.0, j_bound=50.0))
    time = np.linspace(0, move.get_duration(), 20001)
    position, velocity, acceleration, _ = (np.array(one) for one in move.evaluate_full(time))
    back = max(0.0, -np.diff(position).min())
    print(f"{1e3 * way:g} mm from {speed:g} m/s: {time[-1]:.2f} s, ends at {1e3 * position[-1]:.0f} mm with {velocity[-1]:.1f} m/s, ", end="")
    print(f"largest acceleration {np.abs(acceleration).max():.1f} m/s2, {'steps back' if back > 1e-5 else 'goes on'}")
END
diff - seen <<'END'
500 mm from 0 m/s: 0.80 s, ends at 500 mm with 0.0 m/s, largest acceleration 5.0 m/s2, goes on
310 mm from 0 m/s: 0.61 s, ends at 310 mm with 0.0 m/s, largest acceleration 5.0 m/s2, goes on
300 mm from 0 m/s: 0.74 s, ends at 300 mm with 0.0 m/s, largest acceleration 2.5 m/s2, steps back
100 mm from 0 m/s: 0.45 s, ends at 100 mm with 0.0 m/s, largest acceleration 2.5 m/s2, steps back
20 mm from 0.9 m/s: 0.04 s, ends at 40 mm with 0.9 m/s, largest acceleration 0.0 m/s2, goes on
END
