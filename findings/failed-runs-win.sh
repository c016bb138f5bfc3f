#!/bin/sh
# pymoo 0.6.2 and SciPy 1.17.1: the best of a search is a run that failed, where a failed simulation returns NaN.
#
# A misfit over two parameters, without a value where a simulation fails: half of the space. Compared with NaN nothing
# is better, so that who begins there stays: PSO and CMA-ES of pymoo return their first failure as the optimum;
# `scipy.optimize.brute` takes the first NaN of its grid for the lowest, and `differential_evolution` ends with NaN,
# without success; `shgo` says success far from the optimum. `dual_annealing` says success, with NaN or the optimum, by
# its start. GA and DE of pymoo and `direct` are right. Nothing warns. Return a large number for a failed run.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pymoo==0.6.2 scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from pymoo.algorithms.soo.nonconvex.cmaes import CMAES
from pymoo.algorithms.soo.nonconvex.de import DE
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.algorithms.soo.nonconvex.pso import PSO
from pymoo.core.problem import ElementwiseProblem
from pymoo.optimize import minimize
from scipy import optimize


def misfit(x):
    """Lowest, 0, at (-1, 0.5); a simulation beyond 0 fails."""
    return np.nan if x[0] > 0 else (x[0] + 1) ** 2 + (x[1] - 0.5) ** 2


class Fit(ElementwiseProblem):
    def __init__(self):
        super().__init__(n_var=2, n_obj=1, xl=np.array([-3, -3]), xu=np.array([3, 3]))

    def _evaluate(self, x, out, *args, **kwargs):
        out["F"] = misfit(x)


def say(name, best):
    print(f"{name}: best misfit", "NaN" if np.isnan(best) else "near 0" if best < 0.01 else f"{best:.2f}", flush=True)


for name, algorithm in {"PSO": PSO(pop_size=20), "CMAES": CMAES(), "GA": GA(pop_size=20), "DE": DE(pop_size=20)}.items():
    say(f"pymoo {name}", minimize(Fit(), algorithm, ("n_gen", 60), seed=1, verbose=False).F[0])
box = [(-3, 3), (-3, 3)]
say("SciPy brute", optimize.brute(misfit, box, Ns=20, full_output=True)[1])
for name, keys in (
    ("differential_evolution", {"rng": 1}),
    ("shgo", {}),
    ("dual_annealing", {"rng": 1, "maxiter": 200}),
    ("dual_annealing", {"rng": 2, "maxiter": 200}),
    ("dual_annealing", {"rng": 3, "maxiter": 200}),
    ("direct", {}),
):
    found = getattr(optimize, name)(misfit, box, **keys)
    say(f"SciPy {name} {keys}, success {found.success}", found.fun)
END
diff - seen <<'END'
pymoo PSO: best misfit NaN
pymoo CMAES: best misfit NaN
pymoo GA: best misfit near 0
pymoo DE: best misfit near 0
SciPy brute: best misfit NaN
SciPy differential_evolution {'rng': 1}, success False: best misfit NaN
SciPy shgo {}, success True: best misfit 1.25
SciPy dual_annealing {'rng': 1, 'maxiter': 200}, success True: best misfit NaN
SciPy dual_annealing {'rng': 2, 'maxiter': 200}, success True: best misfit near 0
SciPy dual_annealing {'rng': 3, 'maxiter': 200}, success True: best misfit near 0
SciPy direct {}, success True: best misfit near 0
END
