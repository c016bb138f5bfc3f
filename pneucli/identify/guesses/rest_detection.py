"""Where a piston breaks away from rest, and where the sampling hides in which direction it moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RESTED = 4.0  # times what smears a stop: the time of rest, and of motion, that makes a break-away
STARTED = 0.5  # of the speed that tells motion from rest (two standard deviations of noise): there a rest ends
CREEP = 1e-9  # m/s, of a break-away whose velocity noise hides: its direction counts


def breakaways(v: Array, smoothed: Array, started: float, rested: int) -> Array:
    """Return the velocity in m/s at the last sample of each rest that motion follows, else 0; shape of v.

    ``v`` is zero at rest, which ends late: where noise hides the velocity. The ``smoothed`` one tells where it began
    to grow beyond ``started`` m/s; the break-away is at the sample before. Rest and motion last ``rested`` samples.
    """
    out = np.zeros(v.size)
    moving = v != 0.0
    for k in np.flatnonzero(~moving[:-1] & moving[1:]):
        before, after = moving[max(k - rested, 0) : k + 1], v[k + 1 : k + 1 + rested]
        if k >= rested and not before.any() and (np.all(after > 0) or np.all(after < 0)):
            direction = np.sign(after[0])
            slow = np.flatnonzero(direction * smoothed[k - rested : k + 1] < started)
            onset = k - rested + int(slow[-1]) if slow.size else k
            out[onset] = direction * max(direction * smoothed[onset], CREEP)
    return out


def unsure(v: Array, leaving: Array, smeared: int) -> NDArray[np.bool_]:
    """Return where the sign of v, shape (n,), has just changed or soon will: a stop is smeared over some samples.

    And from where it is ``leaving`` a rest, that sample left out.
    """
    out = np.zeros(v.size, dtype=bool)
    change = np.flatnonzero(np.diff(np.sign(v)) != 0)
    for shift in range(1 - smeared, smeared + 1):
        out[np.clip(change + shift, 0, v.size - 1)] = True
    out[:smeared] = out[-smeared:] = True
    for onset in np.flatnonzero(leaving):
        out[onset : onset + int(np.argmax(v[onset:] != 0.0))] = True
    out[leaving != 0.0] = False
    return out
