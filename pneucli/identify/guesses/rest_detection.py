"""Where a piston breaks away from rest, and where the sampling hides in which direction it moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIN_REST_RATIO = 4.0  # times what smears a stop: the time of rest, and of motion, that makes a break-away
ONSET_SPEED_RATIO = (
    0.5  # of the speed that tells motion from rest (two standard deviations of noise): there a rest ends
)
MIN_BREAKAWAY_SPEED = 1e-9  # m/s, of a break-away whose velocity noise hides: its direction counts


def breakaway_velocities(v: Array, smoothed: Array, onset_speed: float, min_samples: int) -> Array:
    """Return the velocity in m/s at the last sample of each rest that motion follows, else 0; shape of v.

    ``v`` is zero at rest, which ends late: where noise hides the velocity. The ``smoothed`` one tells where it began to
    grow beyond ``onset_speed`` m/s; the break-away is at the sample before. Rest and motion last ``min_samples``
    samples.
    """
    out = np.zeros(v.size)
    moving = v != 0.0
    for k in np.flatnonzero(~moving[:-1] & moving[1:]):
        before, after = moving[max(k - min_samples, 0) : k + 1], v[k + 1 : k + 1 + min_samples]
        if k >= min_samples and not before.any() and (np.all(after > 0) or np.all(after < 0)):
            direction = np.sign(after[0])
            slow = np.flatnonzero(direction * smoothed[k - min_samples : k + 1] < onset_speed)
            onset = k - min_samples + int(slow[-1]) if slow.size else k
            out[onset] = direction * max(direction * smoothed[onset], MIN_BREAKAWAY_SPEED)
    return out


def uncertain_direction(v: Array, breakaway: Array, smear_samples: int) -> NDArray[np.bool_]:
    """Return where the sign of v, shape (n,), has just changed or soon will: a stop is smeared over some samples.

    And from where it is ``breakaway`` a rest, that sample left out.
    """
    out = np.zeros(v.size, dtype=bool)
    change = np.flatnonzero(np.diff(np.sign(v)) != 0)
    for shift in range(1 - smear_samples, smear_samples + 1):
        out[np.clip(change + shift, 0, v.size - 1)] = True
    out[:smear_samples] = out[-smear_samples:] = True
    for onset in np.flatnonzero(breakaway):
        out[onset : onset + int(np.argmax(v[onset:] != 0.0))] = True
    out[breakaway != 0.0] = False
    return out
