#!/bin/sh
# osysid 0.1.9: a model learnt while the axis moves is lost in 200 samples of rest.
#
# x(k+1) = 0.9 x(k) + 0.2 u(k), read with noise. `OnlineLinearModel` weights each sample by 0.9 of the next, which
# nobody asked for, so ten samples are its memory: while the command changes every 20 samples the pole is right; at
# rest, where noise is all there is, no later pole is near 0.9. With `alpha=1.0` the pole stays.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile osysid==0.1.9 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import logging

import numpy as np
from osysid import OnlineLinearModel

logging.disable(logging.CRITICAL)


def learn(**keys):
    rng = np.random.default_rng(0)
    model = OnlineLinearModel(1, 1, **keys)
    command = np.repeat(rng.uniform(-5, 5, 100), 20)
    command[1000:] = 0.0  # at rest
    state, poles = 0.0, []
    for u in command:
        after = 0.9 * state + 0.2 * u
        read = np.array([state, after]) + 0.01 * rng.standard_normal(2)
        model.update(read[:1], np.array([u]), read[1:])
        poles.append(model.A.item())
        state = after
    return np.abs(np.array(poles) - 0.9)


for what, off in (("default", learn()), ("alpha 1", learn(alpha=1.0))):
    for when, part in (("moving", off[500:1000]), ("after 200 samples of rest", off[1200:])):
        right = part < 0.05
        share = "all" if right.all() else "some" if right.any() else "none"
        print(f"{what}, {when}: within 0.05 of the pole 0.9: {share}")
END
diff - seen <<'END'
default, moving: within 0.05 of the pole 0.9: all
default, after 200 samples of rest: within 0.05 of the pole 0.9: none
alpha 1, moving: within 0.05 of the pole 0.9: all
alpha 1, after 200 samples of rest: within 0.05 of the pole 0.9: all
END
