#!/bin/sh
# FMPy 0.3.32 (model by pythonfmu 0.7.0): a recorded input is one step older than its row, and events add rows.
#
# The command u is a ramp, u = 10 t; the model returns y = 2 u and the step that it made. A row holds the outputs after
# the step that ends at its time, beside the input that this step had, that of its beginning: at 0.2 s the row says u = 1,
# though u(0.2) = 2. Read as a recording, u is late by one step. The last step is shortened to end at the stop time. An
# input that jumps between two steps splits that step, so that the result has a row off the grid, at 0.15 s.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile FMPy==0.3.32 pythonfmu==0.7.0 numpy==2.4.6
cat > Axis.py <<'END'
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Axis(Fmi2Slave):
    def __init__(self, **keys):
        super().__init__(**keys)
        self.u, self.gain, self.y, self.step = 0.0, 2.0, 0.0, 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("gain", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        for name in ("y", "step"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y, self.step = self.gain * self.u, step_size
        return True
END
v/bin/pythonfmu build -f Axis.py
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from fmpy import simulate_fmu

KIND = [("time", float), ("u", float)]


def show(stop, samples):
    rows = simulate_fmu("Axis.fmu", stop_time=stop, output_interval=0.1, input=np.array(samples, KIND), output=["u", "y", "step"])
    for row in rows:
        print(*(f"{name}={value:g}" for name, value in zip(rows.dtype.names, row)))


show(0.25, [(0, 0), (1, 10)])
print("jump at 0.15 s")
show(0.3, [(0, 0), (0.15, 0), (0.15, 5), (1, 5)])
END
diff - seen <<'END'
time=0 u=0 y=0 step=0
time=0.1 u=0 y=0 step=0.1
time=0.2 u=1 y=2 step=0.1
time=0.25 u=2 y=4 step=0.05
jump at 0.15 s
time=0 u=0 y=0 step=0
time=0.1 u=0 y=0 step=0.1
time=0.15 u=0 y=0 step=0.05
time=0.2 u=5 y=10 step=0.05
time=0.3 u=5 y=10 step=0.1
END
