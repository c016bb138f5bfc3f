#!/bin/sh
# controlpid 0.1.0: its protection against windup drives the integral backwards, so that an axis stops at a third of its way.
#
# A cylinder moved by 0.1 m/s per volt, a target 0.3 m away, 100 V/m and 50 V/(m s), commands of 10 V at most, each 10 ms.
# The first command would be 30 V. The class takes what is beyond the limit, 20 V, from the integral at once, so that the
# output leaves the limit as soon as the error falls. After 0.4 s the axis is at 0.13 m and creeps: it is at 0.25 m after 2.8 s.
# Holding the integral while the command is at its limit brings it there in 0.4 s. The help says "integral anti-windup". A
# measurement that is not 0 at the first call is a jump for the derivative besides: 6 bar give -55 V.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile controlpid==0.1.0
v/bin/python -W ignore - <<'END' | tee seen
from controlpid import PID


def travel(command, seconds):
    """Positions after each of these times, in m."""
    position, found = 0.0, []
    for step in range(301):
        if step in [round(100 * second) for second in seconds]:
            found.append(f"{position:.3f}")
        position += 0.1 * command(position) * 0.01
    return found


class Held:
    """The same gains, and an integral that stands while the command is at its limit."""

    integral = 0.0

    def command(self, position):
        error = 0.3 - position
        wanted = 100 * error + self.integral
        if abs(wanted) < 10:
            self.integral += 50 * error * 0.01
        return max(-10, min(10, wanted))


limited = PID(100, 50, 0, setpoint=0.3, out_min=-10, out_max=10)
print("after (s)  ", times := (0.2, 0.4, 1.0, 2.0, 2.8))
print("controlpid:", *travel(lambda position: limited.step(position, 0.01), times))
print("held:      ", *travel(Held().command, times))
print(f"first derivative at 6 bar: {PID(0, 0, 1, setpoint=6).step(6, 0.01):.1f} V")
END
diff - seen <<'END'
after (s)   (0.2, 0.4, 1.0, 2.0, 2.8)
controlpid: 0.102 0.131 0.178 0.228 0.253
held:       0.200 0.291 0.304 0.302 0.301
first derivative at 6 bar: -54.5 V
END
