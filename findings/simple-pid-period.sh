#!/bin/sh
# simple-pid 2.0.1: with dt = 1 ms given at each call, the controller keeps its first output for ever.
#
# A PI on a lag of 1 s, simulated at 1 kHz with `dt=0.001`. The period `sample_time` is 0.01 s where nobody states it, and a call
# with a shorter dt returns the last output; the short calls are not added up either. After 0.2 s as after 5 s the
# output is that of the first call, a proportional controller of a setpoint, without error or warning: the lag settles at twice the
# setpoint. With a dt of 0.01 s, or with `sample_time=None`, it settles at the setpoint.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile simple-pid==2.0.1
v/bin/python -W ignore - <<'END' | tee seen
from simple_pid import PID


def run(dt, **keys):
    controller, y, outputs = PID(2.0, 5.0, 0.0, setpoint=1.0, **keys), 0.0, set()
    for step in range(1, round(5 / dt) + 1):
        u = controller(y, dt=dt)
        outputs.add(u)
        y += dt * (u - y)
        if step == round(0.2 / dt):
            early = u
    return f"u {early:.3f} at 0.2 s, {u:.3f} at 5 s, y {y:.3f}, different outputs: {len(outputs)}"


print("dt 0.001                  ", run(0.001))
print("dt 0.01                   ", run(0.01))
print("dt 0.001, sample_time None", run(0.001, sample_time=None))
END
diff - seen <<'END'
dt 0.001                   u 2.005 at 0.2 s, 2.005 at 5 s, y 1.992, different outputs: 1
dt 0.01                    u 2.088 at 0.2 s, 1.000 at 5 s, y 1.000, different outputs: 500
dt 0.001, sample_time None u 2.066 at 0.2 s, 1.001 at 5 s, y 1.000, different outputs: 5000
END
