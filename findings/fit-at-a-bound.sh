#!/bin/sh
# lmfit 1.3.4, iminuit 2.33.0: a friction that ends at its bound of 0 has a standard error by chance, or a quarter of the right one.
#
# Forces over velocity whose best Coulomb friction is slightly negative, fitted with a lower bound of 0, as a friction has one. From five
# starts, lmfit gives the same friction (0) and viscous friction (9.56), but no common standard errors: some starts have 0.10 or
# 0.13 N for the first and 0.22 for the second (twice what it is with the Coulomb friction fixed), others none at all, by the last
# bit in which they end. iminuit gives 0.03 N for the friction, where a fit without the bound has 0.12, and calls the fit
# valid.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile lmfit==1.3.4 iminuit==2.33.0 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import lmfit
import numpy as np
from iminuit import Minuit
from iminuit.cost import LeastSquares

v = np.linspace(-1, 1, 41)
force = -0.3 * np.sign(v) + 10 * v + 0.5 * np.cos(37 * v)


def fitted(**coulomb):
    parameters = lmfit.create_params(fc=coulomb, d=5)
    return lmfit.minimize(lambda p: p["fc"].value * np.sign(v) + p["d"].value * v - force, parameters)


def show(what, found):
    texts = (f"{one.value:.2f} +- {one.stderr:.2f}" if one.stderr is not None else f"{one.value:.2f}, no error" for one in found.params.values())
    print(f"{what}:", *(f"{name} {text.replace('-0.00', '0.00')}" for name, text in zip(("Coulomb", "viscous"), texts, strict=True)))


show("without a bound", fitted(value=1))
show("fixed at 0", fitted(value=0, vary=False))
errors = []
for start in (0.5, 1, 2, 5, 20):
    found = fitted(value=start, min=0)
    errors.append(found.params["fc"].stderr or 0.0)
    print(f"bound of 0, start {start}: Coulomb {found.params['fc'].value:.2f}, viscous {found.params['d'].value:.2f}")
print("standard errors of the Coulomb friction equal to 5 %:", max(errors) < 1.05 * min(errors))
fit = Minuit(LeastSquares(v, force, 0.395, lambda v, fc, d: fc * np.sign(v) + d * v), fc=1, d=5)
fit.limits["fc"] = (0, None)
fit.migrad()
print(f"iminuit: Coulomb {fit.values['fc']:.2f} +- {fit.errors['fc']:.2f}, viscous {fit.values['d']:.2f} +- {fit.errors['d']:.2f}, valid {fit.valid}")
END
diff - seen <<'END'
without a bound: Coulomb -0.30 +- 0.12 viscous 10.00 +- 0.20
fixed at 0: Coulomb 0.00 +- 0.00 viscous 9.56 +- 0.10
bound of 0, start 0.5: Coulomb 0.00, viscous 9.56
bound of 0, start 1: Coulomb 0.00, viscous 9.56
bound of 0, start 2: Coulomb 0.00, viscous 9.56
bound of 0, start 5: Coulomb 0.00, viscous 9.56
bound of 0, start 20: Coulomb 0.00, viscous 9.56
standard errors of the Coulomb friction equal to 5 %: False
iminuit: Coulomb 0.00 +- 0.03, viscous 9.56 +- 0.10, valid True
END
