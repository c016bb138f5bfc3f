"""Break-away from rest, and samples at which the direction of motion is uncertain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIN_REST_RATIO = 4.0  # times the smear time: the duration of rest, and of motion, around a break-away
ONSET_SPEED_RATIO = 0.5  # of the standstill speed, so two standard deviations of its noise: there a rest ends
MIN_BREAKAWAY_SPEED = 1e-9  # m/s, of a break-away within the noise: only its direction counts


def breakaway_velocities(v: Array, smoothed: Array, onset_speed: float, min_samples: int) -> Array:
    """Locate break-aways: the last sample of each rest that motion follows.

    The velocity ``v`` is set to zero at rest and leaves zero late, once it exceeds noise. The smoothed velocity shows
    where it began to grow beyond ``onset_speed``; the break-away is the sample before.

    Args:
        v: Velocity in m/s, shape (n,), zero at rest.
        smoothed: Smoothed velocity in m/s, shape (n,).
        onset_speed: Speed at which motion begins, in m/s.
        min_samples: Number of samples of rest before, and of motion in one direction after.

    Returns:
        The velocity in m/s at each break-away, 0 elsewhere, shape (n,).

    """
    out = np.zeros(v.size)
    moving = v != 0.0
    for k in np.flatnonzero(~moving[:-1] & moving[1:]):
        preceding, following = moving[max(k - min_samples, 0) : k + 1], v[k + 1 : k + 1 + min_samples]
        if k >= min_samples and not preceding.any() and (np.all(following > 0) or np.all(following < 0)):
            direction = np.sign(following[0])
            below_onset = np.flatnonzero(direction * smoothed[k - min_samples : k + 1] < onset_speed)
            onset = k - min_samples + int(below_onset[-1]) if below_onset.size else k
            out[onset] = direction * max(direction * smoothed[onset], MIN_BREAKAWAY_SPEED)
    return out


def uncertain_direction(v: Array, breakaway: Array, smear_samples: int) -> NDArray[np.bool_]:
    """Mask the samples whose direction of motion is uncertain.

    It is uncertain near a reversal, at both ends, and from a break-away until the velocity exceeds noise.

    Args:
        v: Velocity in m/s, shape (n,), zero at rest.
        breakaway: Velocity at break-aways, 0 elsewhere, shape (n,).
        smear_samples: Number of samples over which smoothing spreads a stop.

    Returns:
        The mask, shape (n,); False at the break-aways themselves.

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
