#!/bin/sh
# SALib 1.6.0: one simulation of 2048 that fails makes every Sobol index 0, with a confidence interval of 0.
#
# A pressure that depends on two of three parameters, 256 base samples. Without a failure the indices are 0.91, 0.09 and
# 0. One output of NaN, as a simulation that does not converge leaves it, and all three are 0 +- 0, first order and total,
# without a warning: no parameter matters. RBD-FAST and PAWN return NaN for all, FAST for the one parameter in whose part
# the failure lies, Morris masks all. Check outputs with `numpy.isfinite` before; samples cannot be left out, as Sobol's
# are pairs.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile SALib==1.6.0 numpy==2.4.6 scipy==1.17.1 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from SALib.analyze import fast, morris, rbd_fast, sobol
from SALib.sample import fast_sampler, latin
from SALib.sample import morris as morris_sampler
from SALib.sample import sobol as sobol_sampler

problem = {"num_vars": 3, "names": ["leak", "supply", "mass"], "bounds": [[0, 1]] * 3}


def pressure(samples, failed):
    outputs = 6e5 + 1e4 * samples[:, 0] + 3e3 * samples[:, 1] ** 2
    outputs[100 : 100 + failed] = np.nan
    return outputs


def show(what, values):
    print(f"  {what:17s}", *(f"{float(np.ma.filled(value, np.nan)):.2f}" for value in values))


for failed in (0, 1):
    print("failed runs:", failed)
    samples = sobol_sampler.sample(problem, 256, seed=0)
    found = sobol.analyze(problem, pressure(samples, failed), seed=0)
    for key in ("S1", "ST"):
        show(f"sobol {key}", found[key])
    print("  sobol intervals  ", *("above 0" if width > 0 else "0" for width in found["S1_conf"]))
    samples = fast_sampler.sample(problem, 257, seed=0)
    show("fast S1", fast.analyze(problem, pressure(samples, failed), seed=0)["S1"])
    samples = latin.sample(problem, 512, seed=0)
    show("rbd_fast S1", rbd_fast.analyze(problem, samples, pressure(samples, failed), seed=0)["S1"])
    samples = morris_sampler.sample(problem, 50, seed=0)
    show("morris mu*, mbar", np.ma.asarray(morris.analyze(problem, samples, pressure(samples, failed), seed=0)["mu_star"]) / 1e2)
END
diff - seen <<'END'
failed runs: 0
  sobol S1          0.91 0.09 0.00
  sobol ST          0.91 0.09 0.00
  sobol intervals   above 0 above 0 0
  fast S1           0.91 0.09 0.00
  rbd_fast S1       0.91 0.08 0.03
  morris mu*, mbar  100.00 32.40 0.00
failed runs: 1
  sobol S1          0.00 0.00 0.00
  sobol ST          0.00 0.00 0.00
  sobol intervals   0 0 0
  fast S1           nan 0.09 0.00
  rbd_fast S1       nan nan nan
  morris mu*, mbar  nan nan nan
END
