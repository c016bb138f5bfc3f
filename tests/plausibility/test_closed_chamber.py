"""The law of a closed chamber: an offset of its pressure is found, a late pressure is not taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.plausibility.detectors.forces import ClosedChamber

PERIOD, KAPPA = 5e-3, 1.4
TIME = PERIOD * np.arange(1300)


def chamber(frequency: float, late: float = 0.0, offset: float = 0.0) -> ClosedChamber:
    """Return air that is squeezed isentropically by a sine, and read late (s) and with an offset (Pa)."""

    def volume(time: np.ndarray) -> np.ndarray:
        return 1.2e-4 * (1.0 + 0.25 * np.sin(2 * np.pi * frequency * time))

    noise = 50.0 * np.random.default_rng(1).standard_normal(TIME.size)
    p = 3e5 * (1.2e-4 / volume(TIME - late)) ** KAPPA + offset + noise
    lasts = np.full(TIME.size - 1, PERIOD)
    return ClosedChamber(-np.diff(np.log(volume(TIME))), np.diff(p), 0.5 * (p[1:] + p[:-1]), (lasts, lasts**0.5))


def test_ambient_pressure_that_is_counted_twice_is_found() -> None:
    offset, error = chamber(0.5, offset=1e5).offset(KAPPA)
    assert offset == pytest.approx(-1e5, rel=0.05)
    assert error < 0.05 * abs(offset)
    assert abs(chamber(0.5).offset(KAPPA)[0]) < 5e3


def test_a_pressure_that_is_late_in_a_fast_motion_is_no_offset() -> None:
    assert chamber(8.0, late=0.02).offset(KAPPA) == (0.0, 1.0)
