#!/bin/sh
# GEKKO 1.3.3: an input acts in the step before its row, and with three nodes in the step after it.
#
# x' = u, rows every 0.1 s, u = 1 in the row of 0.3 s alone. With two nodes in a step, the default, x rises from 0.2 to 0.3 s:
# the value of a row holds until that row, and the first row's is never used. With three nodes, which are meant for accuracy,
# x rises from 0.3 to 0.4 s. The rise is 0.1 in both, so that neither looks wrong. The ramp u = 10 t ends at 5.5 and at 4.5;
# the integral is 5. An FV keeps its first value in mode 4, and is a signal in mode 7.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile gekko==1.3.3 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from gekko import GEKKO


def run(values, nodes=None, kind="Param", mode=4):
    model = GEKKO(remote=False)
    model.time = np.arange(len(values)) * 0.1
    u, x = getattr(model, kind)(value=values), model.Var(0.0)
    model.Equation(x.dt() == u)
    model.options.IMODE = mode
    if nodes:
        model.options.NODES = nodes
    model.solve(disp=False)
    return x.value


def show(what, values):
    print(f"{what:15s}", *(f"{value:.1f}" for value in values))


pulse = np.where(np.arange(6) == 3, 1.0, 0.0)
show("u", pulse)
show("default", run(pulse))
for nodes in (2, 3, 4):
    show(f"{nodes} nodes", run(pulse, nodes))
show("first row alone", run(np.where(np.arange(6) == 0, 1.0, 0.0)))
for kind in ("MV", "FV"):
    for mode in (4, 7):
        show(f"{kind}, mode {mode}", run(pulse, None, kind, mode))
for nodes in (2, 3):
    print(f"ramp, {nodes} nodes   {run(np.arange(11.0), nodes)[-1]:.2f}")
END
diff - seen <<'END'
u               0.0 0.0 0.0 1.0 0.0 0.0
default         0.0 0.0 0.0 0.1 0.1 0.1
2 nodes         0.0 0.0 0.0 0.1 0.1 0.1
3 nodes         0.0 0.0 0.0 0.0 0.1 0.1
4 nodes         0.0 0.0 0.0 0.0 0.1 0.1
first row alone 0.0 0.0 0.0 0.0 0.0 0.0
MV, mode 4      0.0 0.0 0.0 0.1 0.1 0.1
MV, mode 7      0.0 0.0 0.0 0.1 0.1 0.1
FV, mode 4      0.0 0.0 0.0 0.0 0.0 0.0
FV, mode 7      0.0 0.0 0.0 0.1 0.1 0.1
ramp, 2 nodes   5.50
ramp, 3 nodes   4.50
END
