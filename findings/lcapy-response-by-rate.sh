#!/bin/sh
# lcapy 1.26: the step response of a lag after one time constant is 0.065 at 10 Hz and 0.0063 at 100 Hz; of a gain it is right.
#
# `response(values, times)` of 1/(s + 1) is 0.632 after 1 s. It samples the transfer function, filters, and multiplies the result by the
# period at the end, with each of its methods; a transfer function without s goes another way and is not multiplied. So all but gains
# come out smaller by the rate: a velocity is taken for a tenth, or a thousandth, of what it is. Its symbolic answers
# are right. Its help speaks of "the scaling of the result" and sends one to `discretize`. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile lcapy==1.26 sympy==1.14.0 scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from lcapy import s, transfer
from scipy import signal

plants = {"3": (transfer(3 + 0 * s), ([3], [1])), "1/(s + 1)": (transfer(1 / (s + 1)), ([1], [1, 1])), "1/s": (transfer(1 / s), ([1], [1, 0]))}
for name, (plant, (top, bottom)) in plants.items():
    for rate in (10, 100):
        times = np.arange(rate + 1) / rate
        ones = np.ones_like(times)
        found = [plant.response(ones, times, method=method)[-1] for method in ("bilinear", "forward-euler")]
        right = signal.lsim((top, bottom), ones, times)[1][-1]
        print(f"{name} at {rate} Hz, a step after 1 s: SciPy {right:.3g}, bilinear {found[0]:.3g}, forward Euler {found[1]:.3g}")
END
diff - seen <<'END'
3 at 10 Hz, a step after 1 s: SciPy 3, bilinear 3, forward Euler 3
3 at 100 Hz, a step after 1 s: SciPy 3, bilinear 3, forward Euler 3
1/(s + 1) at 10 Hz, a step after 1 s: SciPy 0.632, bilinear 0.065, forward Euler 0.0651
1/(s + 1) at 100 Hz, a step after 1 s: SciPy 0.632, bilinear 0.00634, forward Euler 0.00634
1/s at 10 Hz, a step after 1 s: SciPy 1, bilinear 0.105, forward Euler 0.1
1/s at 100 Hz, a step after 1 s: SciPy 1, bilinear 0.0101, forward Euler 0.01
END
