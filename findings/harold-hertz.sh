#!/bin/sh
# harold 1.0.3: frequencies go in and come out in Hz, each unless told, and an impulse response begins at 0.
#
# |2 / (s + 1)| at 1 rad/s is 1.414. `frequency_response` takes w = 1 for 1 Hz: 0.314. With `w_unit="rad/s"` the
# response is right, but the frequencies that come back with it are in Hz, 0.159, unless `output_unit` is stated as
# well. The impulse response of 2 exp(-t) is 0 at t = 0, and then the mean of the period before. (harold needs NumPy
# 1.)
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile harold==1.0.3 numpy==1.26.4 scipy==1.11.4 matplotlib==3.8.4
v/bin/python -W ignore - <<'END' | tee seen
import harold
import numpy as np


def show(what, response, w):
    print(f"{what}: |G| = {abs(response).item():.3f} at {w.item():.3f}")


lag = harold.Transfer(2, [1, 1])
show("w = 1, default", *harold.frequency_response(lag, [1.0]))
show("w = 1, w_unit rad/s", *harold.frequency_response(lag, [1.0], w_unit="rad/s"))
show("w = 1, both units rad/s", *harold.frequency_response(lag, [1.0], w_unit="rad/s", output_unit="rad/s"))
impulse, t = harold.simulate_impulse_response(lag, np.linspace(0, 1, 11))
print("impulse:", *(f"{one:.2f}" for one in impulse.ravel()[:4]), " exact:", *(f"{one:.2f}" for one in 2 * np.exp(-t[:4])))
END
diff - seen <<'END'
w = 1, default: |G| = 0.314 at 1.000
w = 1, w_unit rad/s: |G| = 1.414 at 0.159
w = 1, both units rad/s: |G| = 1.414 at 1.000
impulse: 0.00 1.90 1.72 1.56  exact: 2.00 1.81 1.64 1.48
END
