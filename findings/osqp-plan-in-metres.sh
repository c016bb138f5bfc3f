#!/bin/sh
# OSQP 1.1.3: a plan in metres is "solved", and its own accelerations carry the axis 1.8 mm past a limit that it keeps on paper.
#
# A move of 5 mm with a hard limit at 5 mm, 50 steps of 10 ms, states and acceleration as variables, SI units. OSQP's
# tolerance is 0.001 of whatever unit stands there, here a millimetre in each step of the model. The status is "solved", the
# planned positions end within 0.03 mm and keep the limit. Integrated from the planned accelerations, the axis ends at
# 6.81 mm, since the small gaps between the steps add up. The same plan in millimetres is right to 0.04 mm, as is the plan
# in metres with eps_abs and eps_rel of 1e-6. PIQP 0.7.0, unchanged in its defaults too, is right to 0.02 mm in metres.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile osqp==1.1.3 piqp==0.7.0 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import osqp
import piqp
import scipy.sparse as sp

STEPS, DT, TARGET, LIMIT, FORCE = 50, 0.01, 5e-3, 5e-3, 2.0


def plan(unit):
    """Cost, equalities and bounds of the plan, with lengths in `unit` metres."""
    states, model, input_ = 2 * (STEPS + 1), np.array([[1, DT], [0, 1]]), np.array([[DT**2 / 2], [DT]])
    weight = np.diag([1, 1e-3])
    cost = sp.block_diag([sp.kron(sp.eye(STEPS + 1), weight), 1e-6 * sp.eye(STEPS)], format="csc")
    linear = np.r_[np.tile(-weight @ [TARGET / unit, 0], STEPS + 1), np.zeros(STEPS)]
    move = sp.kron(sp.eye(STEPS + 1, k=-1), model) - sp.eye(states)
    push = sp.kron(sp.vstack([sp.csc_matrix((1, STEPS)), sp.eye(STEPS)]), input_)
    high = np.r_[np.tile([LIMIT, 1e3], STEPS + 1), np.full(STEPS, FORCE)] / unit
    low = np.r_[np.full(states, -1e3), np.full(STEPS, -FORCE)] / unit
    return cost, linear, sp.hstack([move, push], format="csc"), np.zeros(states), low, high


def driven(accelerations):
    x = v = 0.0
    for a in accelerations:
        x, v = x + DT * v + DT**2 / 2 * a, v + DT * a
    return x


def show(what, status, solution, unit):
    states = 2 * (STEPS + 1)
    x, a = solution[0:states:2] * unit * 1e3, solution[states:] * unit
    print(f"{what:21s} {status:7s} planned end {x[-1]:.2f} mm, highest {x.max():.2f} mm, driven end {driven(a) * 1e3:.2f} mm")


for what, unit, keys in (("OSQP, m", 1, {}), ("OSQP, mm", 1e-3, {}), ("OSQP, m, 1e-6", 1, {"eps_abs": 1e-6, "eps_rel": 1e-6})):
    cost, linear, equal, zero, low, high = plan(unit)
    solver = osqp.OSQP()
    rows = sp.vstack([equal, sp.eye(len(linear))], format="csc")
    solver.setup(cost, linear, rows, np.r_[zero, low], np.r_[zero, high], verbose=False, **keys)
    result = solver.solve()
    show(what, result.info.status, result.x, unit)
cost, linear, equal, zero, low, high = plan(1)
solver = piqp.SparseSolver()
solver.setup(cost, linear, equal, zero, None, None, None, low, high)
show("PIQP, m", "solved" if solver.solve() == piqp.PIQP_SOLVED else "not", solver.result.x, 1)
END
diff - seen <<'END'
OSQP, m               solved  planned end 4.97 mm, highest 4.98 mm, driven end 6.81 mm
OSQP, mm              solved  planned end 4.98 mm, highest 4.99 mm, driven end 4.96 mm
OSQP, m, 1e-6         solved  planned end 5.00 mm, highest 5.00 mm, driven end 5.00 mm
PIQP, m               solved  planned end 5.00 mm, highest 5.00 mm, driven end 5.00 mm
END
