#!/bin/sh
# statsmodels 0.15.0, formulaic 1.2.2: "flow ~ u + u**2" has no square, "dp ~ p1 - p2" no p2, and "q ~ p2/p1" no ratio.
#
# A formula for least squares is one of terms, not of numbers: u**2 is u with itself, which is u, so that a parabola is
# fitted by a line with an R2 of 0.98; p1 - p2 takes the term p2 away, and the difference of pressures is fitted by one
# of them; p2/p1 is p2 and its product with p1. In formulaic ^ does as **, where patsy refuses it. All are valid in
# either, and say nothing; 2*u is refused. Write I(u**2), I(p1 - p2), or compute columns first, and read the names of
# the parameters.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile statsmodels==0.15.0 patsy==1.0.3 formulaic==1.2.2 pandas==3.0.6 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import formulaic
import numpy as np
import pandas as pd
import statsmodels.formula.api as smf

rng = np.random.default_rng(0)
u, p1, p2 = np.linspace(0.5, 5, 50), rng.uniform(3, 7, 50), rng.uniform(1, 3, 50)
data = pd.DataFrame({"u": u, "p1": p1, "p2": p2, "flow": 1 + 2 * u + 0.5 * u**2, "dp": 3 * (p1 - p2), "q": 2 * p2 / p1})
for formula in (
    "flow ~ u + u**2",
    "flow ~ u + u^2",
    "flow ~ u + I(u**2)",
    "dp ~ p1 - p2",
    "dp ~ I(p1 - p2)",
    "q ~ p2/p1",
    "q ~ I(p2/p1)",
    "flow ~ 2*u",
):
    try:
        fit = smf.ols(formula, data).fit()
        found = ", ".join(f"{name} {value:.3g}" for name, value in fit.params.items() if abs(value) > 1e-9)
        print(f"{formula}: {found}, R2 {fit.rsquared:.4f}", end="; ")
    except Exception as error:
        print(f"{formula}: {type(error).__name__}", end="; ")
    try:
        print("formulaic", list(formulaic.model_matrix(formula.split(" ~ ")[1], data).columns))
    except Exception as error:
        print("formulaic", type(error).__name__)
END
diff - seen <<'END'
flow ~ u + u**2: Intercept -1.9, u 4.75, R2 0.9847; formulaic ['Intercept', 'u']
flow ~ u + u^2: PatsyError; formulaic ['Intercept', 'u']
flow ~ u + I(u**2): Intercept 1, u 2, I(u ** 2) 0.5, R2 1.0000; formulaic ['Intercept', 'u', 'I(u ** 2)']
dp ~ p1 - p2: Intercept -6.75, p1 3.07, R2 0.7840; formulaic ['Intercept', 'p1']
dp ~ I(p1 - p2): I(p1 - p2) 3, R2 1.0000; formulaic ['Intercept', 'I(p1 - p2)']
q ~ p2/p1: Intercept 0.0153, p2 0.869, p2:p1 -0.0904, R2 0.9771; formulaic ['Intercept', 'p2', 'p2:p1']
q ~ I(p2/p1): I(p2 / p1) 2, R2 1.0000; formulaic ['Intercept', 'I(p2 / p1)']
flow ~ 2*u: PatsyError; formulaic FormulaSyntaxError
END
