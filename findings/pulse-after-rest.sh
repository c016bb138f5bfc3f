#!/bin/sh
# SciPy 1.17.1, control 0.10.2, casadi 3.8.2, PathSim 0.27.1: a valve that opens after a rest is never seen.
#
# A lag of 1 s rests at zero; at 5 s its input opens for 1 s, so that the output has to rise to 0.632. At rest a solver
# that chooses its own steps makes them longer and longer, and steps over the pulse. The output is zero at every instant,
# there is no warning, and a finer grid of the input or of the output (here 1 ms) does not help, as the solver does not step
# on it. `input_output_response` of control, cvodes of casadi and a source of PathSim do so as well. `forced_response`,
# fixed steps (rk), a StepSource, whose switching is an event, and `max_step` see it.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 control==0.10.2 casadi==3.8.2 pathsim==0.27.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import logging

import casadi as ca
import control as ct
import numpy as np
from pathsim import Connection, Simulation
from pathsim.blocks import ODE, Scope, Source, StepSource
from pathsim.solvers import RKCK54
from scipy.integrate import solve_ivp

logging.disable(logging.CRITICAL)
t = np.arange(0, 10, 0.001)
u = np.where((t >= 5) & (t < 6), 1.0, 0.0)


def show(what, y):
    print(f"{what:29s} highest {np.max(y):.3f}")


def slope(t, y):
    return -y + (1.0 if 5 <= t < 6 else 0.0)


for method in ("RK45", "DOP853", "Radau", "BDF", "LSODA"):
    show(f"solve_ivp {method}", solve_ivp(slope, (0, 10), [0.0], method, t_eval=t).y)
show("solve_ivp RK45, max_step 0.1", solve_ivp(slope, (0, 10), [0.0], max_step=0.1, t_eval=t).y)
lag = ct.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
show("control input_output_response", ct.input_output_response(lag, t, u).outputs)
show("control forced_response", ct.forced_response(lag, t, u).outputs)
x, now = ca.SX.sym("x"), ca.SX.sym("t")
lag = {"x": x, "t": now, "ode": -x + ca.if_else(ca.logic_and(now >= 5, now < 6), 1, 0)}
show("casadi cvodes", ca.integrator("I", "cvodes", lag, 0, t[1:])(x0=0)["xf"].full())
show("casadi rk", ca.integrator("I", "rk", lag, 0, t[10::10])(x0=0)["xf"].full())
for what, source in (("Source", Source(lambda t: 1.0 if 5 <= t < 6 else 0.0)), ("StepSource", StepSource([0, 1, 0], [0, 5, 6]))):
    lag, scope = ODE(lambda x, u, t: u - x, np.zeros(1)), Scope()
    Simulation([source, lag, scope], [Connection(source, lag), Connection(lag, scope)], Solver=RKCK54, log=False).run(10)
    show(f"PathSim RKCK54, {what}", scope.read()[1])
END
diff - seen <<'END'
solve_ivp RK45                highest 0.000
solve_ivp DOP853              highest 0.000
solve_ivp Radau               highest 0.000
solve_ivp BDF                 highest 0.000
solve_ivp LSODA               highest 0.000
solve_ivp RK45, max_step 0.1  highest 0.625
control input_output_response highest 0.000
control forced_response       highest 0.632
casadi cvodes                 highest 0.000
casadi rk                     highest 0.631
PathSim RKCK54, Source        highest 0.000
PathSim RKCK54, StepSource    highest 0.632
END
