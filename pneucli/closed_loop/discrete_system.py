"""Discrete-time linear systems: impulse responses, delays, and realisation from an impulse response."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SINGULAR_VALUE_TOLERANCE = (
    1e-4  # singular values below that share of the largest are the way that the piston makes meanwhile
)


@dataclass(frozen=True)
class DiscreteSystem:
    """A discrete-time linear system: ``x+ = A x + B u``, ``y = C x + D u``; u and y in SI."""

    A: Array
    B: Array
    C: Array
    D: Array

    def transfer_matrix(self, z: Array) -> Array:
        """Return the transfer matrix at the complex numbers ``z`` (n,): shape (n, outputs, inputs)."""
        if not self.A.size:
            return np.broadcast_to(self.D.astype(complex), (z.size, *self.D.shape))
        inner = z[:, None, None] * np.eye(len(self.A)) - self.A
        return np.asarray(self.C @ np.linalg.solve(inner, self.B.astype(complex)[None]) + self.D)


def realise_impulse_response(markov: Array) -> tuple[DiscreteSystem, float]:
    """Return a system with the impulse response ``markov`` (n, outputs, inputs), and the relative error of it.

    Scale outputs and inputs to responses of about 1.

    References:
        Ho and Kalman (1966); Kung (1978), by the singular values of the block Hankel matrix.

    """
    n, outputs, inputs = markov.shape
    half = n // 2
    rows = np.arange(half)[:, None] + np.arange(half)
    hankel, shifted = (markov[rows + i].transpose(0, 2, 1, 3).reshape(half * outputs, half * inputs) for i in (0, 1))
    left, size, right = np.linalg.svd(hankel, full_matrices=False)
    order = int(np.sum(size > SINGULAR_VALUE_TOLERANCE * size[0]))
    root = np.sqrt(size[:order])
    U, V = left[:, :order], right[:order].T
    A, B, C = (U / root).T @ shifted @ (V / root), (V * root).T[:, :inputs], (U * root)[:outputs]
    missed = float(np.max(np.abs(impulse_response(A, B, C, n) - markov)))
    return DiscreteSystem(A, B, C, np.zeros((outputs, inputs))), missed


def with_input_delay(system: DiscreteSystem, samples: int) -> DiscreteSystem:
    """Return a system whose inputs are delayed by a number of samples."""
    m = system.B.shape[1]
    for _ in range(samples):
        A = np.block([[system.A, system.B], [np.zeros((m, len(system.A) + m))]])
        B = np.vstack([np.zeros((len(system.A), m)), np.eye(m)])
        system = DiscreteSystem(A, B, np.hstack([system.C, np.zeros((len(system.C), m))]), system.D)
    return system


def impulse_response(A: Array, B: Array, C: Array, n: int) -> Array:
    """Return the impulse response from the next sample on, shape (n, outputs, inputs)."""
    found, state = np.empty((n, len(C), B.shape[1])), B
    for i in range(n):
        found[i] = C @ state
        state = A @ state
    return np.nan_to_num(found, nan=np.inf, posinf=np.inf, neginf=-np.inf)


def observable_part(system: DiscreteSystem) -> DiscreteSystem:
    """Return a system without the states that do not reach an output."""
    kept = np.any(system.C != 0.0, axis=0)
    while np.any(more := np.any(system.A[kept] != 0.0, axis=0) & ~kept):
        kept |= more
    return DiscreteSystem(system.A[np.ix_(kept, kept)], system.B[kept], system.C[:, kept], system.D)
