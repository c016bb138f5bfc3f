#!/bin/sh
# control 0.10.2, SciPy 1.17.1: states of a plant that `c2d` sampled by "foh" are not its own; a loop placed on them is unstable.
#
# A cylinder as position, velocity, acceleration (30 rad/s, damping 0.1), each measured, 200 Hz. `place(d.A, d.B, ...)`
# for poles at 0.05 to 0.07 on `c2d(plant, h, method)` gives a gain for the measured states. On the plant under a held
# command the largest pole is 0.07 for "zoh", 0.43 for "tustin", and 1.14 for "foh": unstable. The discretised model has
# outputs that are right, and states that mix in the command (x - M u), so that u = -K x is another law. D is no longer
# zero, which is all that shows. `dlqr` is off in the same way, less so as it is slower. The help of c2d,
# `StateSpace.sample` and `cont2discrete` does not say it. Design state feedback on "zoh".
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile control==0.10.2 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import control
import numpy as np

rate, damping = 30.0, 0.1
a = np.array([[0, 1, 0], [0, 0, 1], [0, -(rate**2), -2 * damping * rate]])
plant = control.ss(a, [[0], [0], [rate**2]], np.eye(3), 0)
period = 0.005
true = control.c2d(plant, period, "zoh")
for poles in ([0.05, 0.06, 0.07], [0.5, 0.51, 0.52]):
    for method in ("zoh", "tustin", "foh"):
        model = control.c2d(plant, period, method)
        gain = control.place(model.A, model.B, poles)
        largest = [np.abs(np.linalg.eigvals(one.A - one.B @ gain)).max() for one in (model, true)]
        print(f"{method:6s} largest pole stated {max(poles)}, of the model {largest[0]:.2f}, of the plant {largest[1]:.2f}")
time = np.arange(0, 0.5, period)
for method in ("zoh", "foh"):
    found = control.forced_response(control.c2d(plant, period, method), time, np.ones(time.size))
    print(f"{method}: acceleration at 0.1 s as output {found.outputs[2, 20]:.1f}, as state {found.states[2, 20]:.1f}")
END
diff - seen <<'END'
zoh    largest pole stated 0.07, of the model 0.07, of the plant 0.07
tustin largest pole stated 0.07, of the model 0.07, of the plant 0.43
foh    largest pole stated 0.07, of the model 0.07, of the plant 1.14
zoh    largest pole stated 0.52, of the model 0.52, of the plant 0.52
tustin largest pole stated 0.52, of the model 0.52, of the plant 0.62
foh    largest pole stated 0.52, of the model 0.52, of the plant 0.72
zoh: acceleration at 0.1 s as output 3.5, as state 3.5
foh: acceleration at 0.1 s as output 1.8, as state -0.4
END
