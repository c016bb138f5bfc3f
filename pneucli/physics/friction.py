"""Friction laws over velocity (thesis 3.1-3.7), vectorised; N, m/s, N s/m.

The simulator composes the same laws from the base model (Coulomb and viscous) and the effects ``stribeck`` and
``friction-hysteresis``; these closed forms serve fits of measured friction curves, plots and tests.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def coulomb(v: Array, coulomb: float) -> Array:
    """Return dry friction (3.1); 0 at standstill, where any value between -coulomb and coulomb is possible."""
    return coulomb * np.sign(v)


def coulomb_viscous(v: Array, coulomb: float, viscous: float) -> Array:
    """Return dry and viscous friction (3.3, 3.4)."""
    return coulomb * np.sign(v) + viscous * v


def stribeck_exponential(
    v: Array, coulomb: float, viscous: float, static: float, velocity: float, exponent: float = 2.0
) -> Array:
    """Return Stribeck friction with the exponential fall from static to Coulomb friction (3.5)."""
    fall = np.exp(-(np.abs(v / velocity) ** exponent))
    return (coulomb + (static - coulomb) * fall) * np.sign(v) + viscous * v


def stribeck(v: Array, coulomb: float, viscous: float, static: float, velocity: float) -> Array:
    """Return Stribeck friction in the form of Hess and Soom (3.6)."""
    return (coulomb + (static - coulomb) / (1.0 + (v / velocity) ** 2)) * np.sign(v) + viscous * v


def nouri(v: Array, a: Array, rising: tuple[float, float, float, float], falling: tuple[float, float]) -> Array:
    """Return hysteretic friction (3.7): Stribeck (coulomb, viscous, static, velocity) while speeding up,
    Coulomb and viscous with constants of their own (coulomb, viscous) while slowing.
    """
    speeding_up = np.sign(v) == np.sign(a)
    return np.where(speeding_up, stribeck(v, *rising), coulomb_viscous(v, *falling))
