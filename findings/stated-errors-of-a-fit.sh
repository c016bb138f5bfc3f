#!/bin/sh
# lmfit 1.3.4, odrpack 0.7.0, iminuit 2.33.0: one line, one statement of errors, and standard errors that differ by ten.
#
# Forty forces over velocity, scatter 0.1 N, from a sensor with a stated standard uncertainty of 1 N in each reading. The standard
# error of the viscous friction follows from the statement in iminuit (0.267 N s/m). lmfit takes the weights 1/u and returns 0.027,
# from the scatter, unless `scale_covar=False`. odrpack returns both for the same thing: `sd_beta` from the scatter, the
# root of `cov_beta` from the statement. Where the model is wrong, and the scatter ten times what was stated, the roles
# change: iminuit and `cov_beta` say 0.027. So an error bar says which library made it.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile lmfit==1.3.4 odrpack==0.7.0 iminuit==2.33.0 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import lmfit
import numpy as np
import odrpack
from iminuit import Minuit
from iminuit.cost import LeastSquares

v = np.linspace(-1, 1, 40)


def line(v, d, f0):
    return d * v + f0


def show(scatter, stated):
    force = line(v, 10.0, 2.0) + scatter * np.sqrt(2) * np.sin(np.arange(40) * 2.7)
    print(f"scatter {scatter} N, stated {stated} N")
    fit = Minuit(LeastSquares(v, force, stated, line), d=1, f0=0)
    fit.migrad()
    print(f"  iminuit                   {fit.errors['d']:.4f}")
    for scaled in (True, False):
        found = lmfit.Model(line).fit(force, v=v, d=1, f0=0, weights=1 / stated, scale_covar=scaled)
        print(f"  lmfit, scale_covar={scaled!s:5s}  {found.params['d'].stderr:.4f}")
    weight = np.full(40, 1 / stated**2)
    found = odrpack.odr_fit(lambda x, beta: beta[0] * x + beta[1], v, force, np.array([1.0, 0.0]), weight_y=weight, task="OLS")
    print(f"  odrpack, sd_beta          {found.sd_beta[0]:.4f}")
    print(f"  odrpack, sqrt of cov_beta {found.cov_beta[0, 0] ** 0.5:.4f}")


show(0.1, 1.0)
show(1.0, 0.1)
END
diff - seen <<'END'
scatter 0.1 N, stated 1.0 N
  iminuit                   0.2671
  lmfit, scale_covar=True   0.0273
  lmfit, scale_covar=False  0.2671
  odrpack, sd_beta          0.0273
  odrpack, sqrt of cov_beta 0.2671
scatter 1.0 N, stated 0.1 N
  iminuit                   0.0267
  lmfit, scale_covar=True   0.2734
  lmfit, scale_covar=False  0.0267
  odrpack, sd_beta          0.2734
  odrpack, sqrt of cov_beta 0.0267
END
