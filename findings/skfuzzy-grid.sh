#!/bin/sh
# scikit-fuzzy 0.5.0: how hard a fuzzy controller pushes near its target depends on the grid of its axes, by a factor of 20.
#
# Three rules (negative, zero, positive), the triangle of zero from -0.4 to 0.4, commands of -10, 0 and 10 V. At an error
# of 0.45, outside that triangle, the command is 0.5 V where the axes are `arange(-10, 11, 1)`, 3.0 V with steps of 0.5,
# and 9.5 V with steps of 0.1: memberships are looked up between points of the grid, where a triangle of 0.4 is a triangle
# of 1. An error of -30 is taken as -10 in silence. Nothing checks that a term fits its grid. Use a step well below the
# narrowest term.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scikit-fuzzy==0.5.0 networkx==3.6.1 packaging==26.4 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import skfuzzy
from skfuzzy import control


def command(step, error):
    """Command in V of three rules on axes with this step."""
    axis = np.arange(-10, 10 + step / 2, step)
    e, u = control.Antecedent(axis, "e"), control.Consequent(axis, "u")
    zero = [-0.4, 0, 0.4]
    terms = (("low", [-10, -10, 0], [-10, -10, -9]), ("zero", zero, zero), ("high", [0, 10, 10], [9, 10, 10]))
    for name, errors, commands in terms:
        e[name], u[name] = skfuzzy.trimf(axis, errors), skfuzzy.trimf(axis, commands)
    rules = [control.Rule(e[name], u[name]) for name in ("low", "zero", "high")]
    found = control.ControlSystemSimulation(control.ControlSystem(rules))
    found.input["e"] = error
    found.compute()
    return found.output["u"]


for step in (1, 0.5, 0.25, 0.1, 0.05):
    print(f"grid of {step:4g}:", *(f"error {error:g}: {command(step, error):.2f} V" for error in (0.2, 0.45, 5)), sep="   ")
print(f"error -30: {command(0.1, -30):.2f} V, error -10: {command(0.1, -10):.2f} V")
END
diff - seen <<'END'
grid of    1:   error 0.2: 0.19 V   error 0.45: 0.50 V   error 5: 9.61 V
grid of  0.5:   error 0.2: 0.43 V   error 0.45: 3.01 V   error 5: 9.61 V
grid of 0.25:   error 0.2: 0.53 V   error 0.45: 3.63 V   error 5: 9.61 V
grid of  0.1:   error 0.2: 0.59 V   error 0.45: 9.51 V   error 5: 9.61 V
grid of 0.05:   error 0.2: 0.59 V   error 0.45: 9.51 V   error 5: 9.60 V
error -30: -9.67 V, error -10: -9.67 V
END
