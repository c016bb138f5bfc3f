#!/bin/sh
# SciPy 1.17.1: a piston restarted at its end stop after `solve_ivp`'s event goes through the stop, or does not move at all.
#
# A piston falls on an end stop (restitution 0.5), each bounce an event and a new call. After dozens of bounces, each shorter,
# an event ends a hair below zero, the next call begins there and sees no crossing: the piston is 32 m below the stop at 3 s.
# Pushed against the stop from rest, the call ends at once, also where the event has a direction; leaving it with 1 m/s too where
# the event has none. With `t_eval`, the last state is that of the last stamp before the stop, not that of the stop.
# The event's own state is in `y_events`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from scipy.integrate import solve_ivp


def fall(start, end, state, direction=-1.0, **keys):
    def stop(_, state):
        return state[0]

    stop.terminal, stop.direction = True, direction
    return solve_ivp(lambda _, state: [state[1], -9.81], (start, end), state, events=stop, **keys)


time, state, bounces = 0.0, [0.1, 0.0], 0
while True:
    run = fall(time, 3.0, state, rtol=1e-6, atol=1e-9)
    if run.status != 1:
        break
    time, state, bounces = run.t[-1], [run.y[0, -1], -0.5 * run.y[1, -1]], bounces + 1
print(f"dozens of bounces {20 < bounces < 200}, the last at {time:.3f} s; at 3 s the piston is at {run.y[0, -1]:.0f} m")
for what, velocity, direction in (("pushed", 0.0, -1.0), ("leaves", 1.0, -1.0), ("leaves, no direction", 1.0, 0.0)):
    run = fall(0.0, 1.0, [0.0, velocity], direction)
    print(f"{what}: status {run.status}, ends at {run.t[-1]:.3f} s")
run = fall(0.0, 1.0, [0.1, 0.0], t_eval=np.arange(0, 1, 0.01))
print(f"t_eval: last state {run.y[0, -1]:.4f} m at {run.t[-1]:.2f} s; y_events {abs(run.y_events[0][0][0]):.4f} m at {run.t_events[0][0]:.3f} s")
END
diff - seen <<'END'
dozens of bounces True, the last at 0.428 s; at 3 s the piston is at -32 m
pushed: status 1, ends at 0.000 s
leaves: status 1, ends at 0.204 s
leaves, no direction: status 1, ends at 0.000 s
t_eval: last state 0.0039 m at 0.14 s; y_events 0.0000 m at 0.143 s
END
