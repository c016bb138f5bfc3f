#!/bin/sh
# GEKKO 1.3.3: the gain K that `sysid` hands over is 3.03 for a plant of gain 2.5 and for one of gain 25; its delay starts at 0.
#
# y(k) = 0.8 y(k-1) + 0.5 u(k-1), driven by noise and read exactly, in two units. `sysid` finds both coefficients exactly, and hands over beside
# them K, "gain matrix", which is the gain of the data scaled to between zero and one: the true one times the range of u over that of y.
# With `scale=False` K is the gain. And `delay(u, y, 3)` of a command that rests at 5 V begins with three samples of 0 V, a
# step that nobody made. Nothing warns. Compute b / (1 - a).
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile gekko==1.3.3 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from gekko import GEKKO

COUNT = 400
noise = np.random.default_rng(0).standard_normal(COUNT)
for size, unit in ((1, 1), (2, 1), (1, 10)):
    u, y = size * noise, np.zeros(COUNT)
    for k in range(1, COUNT):
        y[k] = 0.8 * y[k - 1] + 0.5 * unit * u[k - 1]
    for keys in ({}, {"scale": False}):
        _, found, gain = GEKKO(remote=False).sysid(np.arange(COUNT) * 0.1, u, y, 1, 1, pred="meas", **keys)
        a, b = found["a"].item(), found["b"].item()
        print(f"u of {size}, y times {unit}, {keys or 'default'}: a {a:.3f}, b {b:.3f}, b / (1 - a) {b / (1 - a):.3g}, K {gain.item():.3g}")

model = GEKKO(remote=False)
model.time = np.linspace(0, 0.7, 8)
command, late = model.Param([5.0] * 3 + [8.0] * 5), model.Var()
model.delay(command, late, 3)
model.options.IMODE = 4
model.solve(disp=False)
print("command", *(f"{one:g}" for one in command.value), "| three steps later", *(f"{one:g}" for one in late.value))
END
diff - seen <<'END'
u of 1, y times 1, default: a 0.800, b 0.500, b / (1 - a) 2.5, K 3.03
u of 1, y times 1, {'scale': False}: a 0.800, b 0.500, b / (1 - a) 2.5, K 2.5
u of 2, y times 1, default: a 0.800, b 0.500, b / (1 - a) 2.5, K 3.03
u of 2, y times 1, {'scale': False}: a 0.800, b 0.500, b / (1 - a) 2.5, K 2.5
u of 1, y times 10, default: a 0.800, b 5.000, b / (1 - a) 25, K 3.03
u of 1, y times 10, {'scale': False}: a 0.800, b 5.000, b / (1 - a) 25, K 25
command 5 5 5 8 8 8 8 8 | three steps later 0 0 0 5 5 5 8 8
END
