#!/bin/sh
# statsmodels 0.15.0: a command has no dynamics in ARIMA and SARIMAX; the gain is a tenth, and their constants differ.
#
# y(k) = 0.9 y(k-1) + 0.2 u(k-1) about 6 bar: a pole of 0.9, a gain of 2. `AutoReg` and `ARDL` with the command as
# `exog` find both. `SARIMAX` and `ARIMA` of order (1, 0, 0) with the same `exog` fit another model, y = b u and a
# noise that has the pole: b is 0.2, the pole 1.00, without a warning. The constant of `ARIMA` is a level, 7.3; that
# of the three others is a level times (1 - pole).
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile statsmodels==0.15.0 numpy==2.4.6 pandas==3.0.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from statsmodels.tsa.api import ARDL, ARIMA, SARIMAX, AutoReg

rng = np.random.default_rng(0)
u = np.repeat(rng.uniform(-5, 5, 100), 20)
y = np.zeros(u.size)
for k in range(1, u.size):
    y[k] = 0.9 * y[k - 1] + 0.2 * u[k - 1] + 0.01 * rng.standard_normal()
y, u = y[1:] + 6.0, u[:-1]


def show(what, pole, gain, constant):
    print(f"{what:8s} pole {pole:.2f}  gain {gain:.1f}  constant {constant:.1f}")


constant, pole, b = AutoReg(y, 1, trend="c", exog=u).fit().params
show("AutoReg", pole, b / (1 - pole), constant)
constant, pole, b = ARDL(y, 1, u[:, None], 0, trend="c").fit().params
show("ARDL", pole, b / (1 - pole), constant)
constant, b, pole, _ = SARIMAX(y, exog=u, order=(1, 0, 0), trend="c").fit(disp=0).params
show("SARIMAX", pole, b, constant)
constant, b, pole, _ = ARIMA(y, exog=u, order=(1, 0, 0), trend="c").fit().params
show("ARIMA", pole, b, constant)
END
diff - seen <<'END'
AutoReg  pole 0.90  gain 2.0  constant 0.6
ARDL     pole 0.90  gain 2.0  constant 0.6
SARIMAX  pole 1.00  gain 0.2  constant 0.0
ARIMA    pole 1.00  gain 0.2  constant 7.3
END
