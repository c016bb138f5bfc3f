#!/bin/sh
# pidcon 0.1.0, pid-controller 0.2.0, simplepidcontroller 1.0.0: the integral of 1 over 1 s is 5500 or -0.1; a derivative of 1 is 0.001 or 0.2.
#
# One error, five controllers, at 10 Hz and 100 Hz. py-pidx 1.1.1 and classic-controlling 0.2.0 say 1 for the integral, and 6 for half an error of
# 10 that grew by 10 a second with a derivative gain of 0.1. pidcon counts milliseconds since it was made at each call, so that its integral grows
# with the square of time and with the rate, and its derivative is the error over that time. pid-controller keeps no sum: its integral
# is one period's. It turns the sign of P and I, not that of D, which so works against them. simplepidcontroller
# multiplies the derivative by Td twice. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pidcon==0.1.0 pid-controller==0.2.0 simplepidcontroller==1.0.0 py-pidx==1.1.1 classic-controlling==0.2.0 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
from classic_controlling import PID as Classic
from pid_controller.pid import PID as PidController
from pidcon import PID as Pidcon
from py_pidx import PID as Pidx
from simplepidcontroller import PID as SimplePid


class Stepped(Pidcon):
    """pidcon without its threads: the time is what `now` says."""

    now = 0.0

    def __init__(self, **gains):
        super().__init__(1e9, **gains)
        self._output_timer.cancel()
        self._last_time, self.seen = 0.0, []
        self.enable_pid()
        self.on_new_output += self.seen.append

    def _get_current_time_ms(self=None):
        return Stepped.now * 1e3

    def run(self, error):
        self.input_error = error
        self.calculate_output()
        self._output_timer.cancel()
        return self.seen[-1]


def runs(kp, ki, kd, period):
    simple = SimplePid(0.0)
    simple.parallel_constants = kp, ki, kd
    pidcon = Stepped(kp=kp, ki=ki, kd=kd)
    classic = Classic(kp, kp / ki, kd / kp, period)
    plain = PidController(kp, ki, kd, get_time=lambda: 0.0)
    pidx = Pidx(kp, ki, kd, sample_time=0)
    return {
        "py-pidx": lambda error, time: pidx.run(-error, period),
        "classic-controlling": lambda error, time: classic.step(0.0, -error),
        "simplepidcontroller": lambda error, time: simple.compute(-error, period),
        "pid-controller": lambda error, time: plain(-error, time),
        "pidcon": lambda error, time: pidcon.run(error),
    }


def last(gains, error_at, rate):
    found = {}
    for name, run in runs(*gains, 1 / rate).items():
        for k in range(1, rate + 1):
            Stepped.now = k / rate
            found[name] = run(error_at(k / rate), k / rate)
    return found


for rate in (10, 100):
    integral = last((1e-9, 1.0, 0.0), lambda time: 1.0, rate)
    both = last((0.5, 1e-9, 0.1), lambda time: 10 * time, rate)
    for name in integral:
        print(f"{name} at {rate} Hz: integral of 1 over 1 s {integral[name]:.3g}; 0.5 times 10 and 0.1 times a slope of 10 {both[name]:.3g}")
END
diff - seen <<'END'
py-pidx at 10 Hz: integral of 1 over 1 s 1; 0.5 times 10 and 0.1 times a slope of 10 6
classic-controlling at 10 Hz: integral of 1 over 1 s 1; 0.5 times 10 and 0.1 times a slope of 10 6
simplepidcontroller at 10 Hz: integral of 1 over 1 s 1; 0.5 times 10 and 0.1 times a slope of 10 5.2
pid-controller at 10 Hz: integral of 1 over 1 s -0.1; 0.5 times 10 and 0.1 times a slope of 10 -4
pidcon at 10 Hz: integral of 1 over 1 s 5.5e+03; 0.5 times 10 and 0.1 times a slope of 10 5
py-pidx at 100 Hz: integral of 1 over 1 s 1; 0.5 times 10 and 0.1 times a slope of 10 6
classic-controlling at 100 Hz: integral of 1 over 1 s 1; 0.5 times 10 and 0.1 times a slope of 10 6
simplepidcontroller at 100 Hz: integral of 1 over 1 s 1; 0.5 times 10 and 0.1 times a slope of 10 5.2
pid-controller at 100 Hz: integral of 1 over 1 s -0.01; 0.5 times 10 and 0.1 times a slope of 10 -4
pidcon at 100 Hz: integral of 1 over 1 s 5.05e+04; 0.5 times 10 and 0.1 times a slope of 10 5
END
