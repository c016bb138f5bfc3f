#!/bin/sh
# kneed 0.9.0: a flow that saturates at 6 V has its knee below 1 V with 1 % of noise.
#
# A flow that rises to 6 V and stays, exact: 5.98 V, right. With noise of a hundredth of the range, `KneeLocator` with
# all else default takes one of the first bends of the noise: in all of 20 recordings the knee is below 1 V. A
# sensitivity of 5 in place of 1 finds it in a few, 20 finds none at all. Rows in another order, as a table by run has
# them, go wrong without any noise: voltages are taken for sorted. Nothing warns but where no knee is found. Sort, and
# state `interp_method="polynomial"`, or fit two lines.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile kneed==0.9.0 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from kneed import KneeLocator

volts = np.linspace(0, 10, 200)
flow = np.minimum(volts, 6.0)


def knees(pairs, **options):
    found = [KneeLocator(u, q, curve="concave", direction="increasing", **options).knee for u, q in pairs]
    return [np.nan if knee is None else float(knee) for knee in found]


def say(what, found):
    near = sum(abs(knee - 6) < 0.5 for knee in found)
    print(f"{what}: within 0.5 V in {near} of {len(found)}, below 1 V in {sum(knee < 1 for knee in found)}", end=", ")
    print(f"none in {sum(np.isnan(found))}")


rngs = [np.random.default_rng(seed) for seed in range(20)]
noisy = [(volts, flow + rng.normal(0, 0.06, volts.size)) for rng in rngs]
orders = [rng.permutation(volts.size) for rng in rngs]
say("exact", knees([(volts, flow)]))
say("exact, rows in another order", knees([(volts[order], flow[order]) for order in orders]))
say("noise of 1 %", knees(noisy))
for options in ({"S": 5}, {"S": 20}, {"interp_method": "polynomial"}):
    say(f"noise of 1 %, {options}", knees(noisy, **options))
END
diff - seen <<'END'
exact: within 0.5 V in 1 of 1, below 1 V in 0, none in 0
exact, rows in another order: within 0.5 V in 4 of 20, below 1 V in 1, none in 0
noise of 1 %: within 0.5 V in 0 of 20, below 1 V in 20, none in 0
noise of 1 %, {'S': 5}: within 0.5 V in 3 of 20, below 1 V in 8, none in 0
noise of 1 %, {'S': 20}: within 0.5 V in 0 of 20, below 1 V in 0, none in 20
noise of 1 %, {'interp_method': 'polynomial'}: within 0.5 V in 20 of 20, below 1 V in 0, none in 0
END
