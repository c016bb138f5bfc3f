#!/bin/sh
# FMPy 0.3.32 (model by pythonfmu 0.7.0): a column of the input that is no input of the model is left out in silence.
#
# With a column "U" for the input "u", FMPy prints that the input for "u" is missing, simulates with u = 0, and does not
# mention "U"; beside a right column for "u" a wrong one leaves no trace at all. A column for a tunable parameter ("gain") is
# taken. In start_values an unknown name raises, so that one spelling mistake is an error there and a zero here.
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


def last(columns, **keys):
    kind = [("time", float), *((name, float) for name in columns)]
    samples = np.array(list(zip([0.0, 0.1, 0.2, 0.3], *columns.values())), kind) if columns else None
    row = simulate_fmu("Axis.fmu", stop_time=0.3, output_interval=0.1, input=samples, output=["u", "gain", "y"], **keys)[-1]
    return "u={1:g} gain={2:g} y={3:g}".format(*row)


print("U", last({"U": [5, 5, 5, 5]}))
print("u and U", last({"u": [5, 5, 5, 5], "U": [7, 7, 7, 7]}))
print("u and gain", last({"u": [5, 5, 5, 5], "gain": [4, 4, 4, 4]}))
print("start value", last({"u": [5, 5, 5, 5]}, start_values={"gain": 4.0}))
try:
    last({}, start_values={"U": 5.0})
except Exception as error:
    print(type(error).__name__, error)
END
diff - seen <<'END'
Warning: missing input for variable "u"
U u=0 gain=2 y=0
u and U u=5 gain=2 y=10
u and gain u=5 gain=4 y=20
start value u=5 gain=4 y=20
Exception The start values for the following variables could not be set: U
END
