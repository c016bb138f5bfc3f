"""A recording in blocks: smooth values, slopes and curvatures of its signals, and lines fitted through them.

A block is the shortest in which motion stands well above the noise, so that physics is not smoothed away with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneucli.arrays import Array, Indices
from pneucli.recording import Recording

MIN_BLOCK_SAMPLES = 6  # samples of a block: a parabola through it leaves as many to tell its noise from
MIN_BLOCKS = 16  # blocks that a statement about a recording needs
# times its noise, that slopes stand clear of it: what noise in x takes off a fitted line is then 1 %
MIN_SIGNAL_TO_NOISE = 10.0
JACKKNIFE_GROUPS = 10  # stretches of a recording, left out one at a time, that tell how sure a line is
FOLDS = 10  # of the blocks, each predicted from the others
MAX_DURATION_RATIO = 1.5  # of its usual duration: a longer block has a gap in it


@dataclass(frozen=True)
class Blocks:
    """Blocks of equal numbers of samples; ``time`` has shape ``(blocks, samples)``, ``rows`` are those of the signals.

    What is left over at the end, and blocks with a gap, are left out.
    """

    recording: Recording
    rows: Indices
    time: Array
    width: int

    @classmethod
    def cut(cls, recording: Recording, signal: str, width: int) -> Blocks:
        """Cut a recording into blocks of ``width`` samples of ``signal``."""
        measured = np.flatnonzero(np.isfinite(recording[signal]))
        rows: Indices = measured[: measured.size // width * width].reshape(-1, width)
        time = recording.time[rows]
        lasts = time[:, -1] - time[:, 0]
        whole = lasts < MAX_DURATION_RATIO * np.median(lasts) if lasts.size else np.zeros(0, dtype=bool)
        return cls(recording, rows[whole], time[whole], width)

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self.rows.shape[0])

    @cached_property
    def half_duration(self) -> Array:
        """Half of each block's duration in s, shape ``(blocks,)``."""
        return np.asarray(0.5 * (self.time[:, -1] - self.time[:, 0]))

    @cached_property
    def tau(self) -> Array:
        """Time within each block, -1 to 1."""
        return np.asarray((self.time - self.time.mean(axis=1, keepdims=True)) / self.half_duration[:, None])

    def values(self, signal: str) -> Array:
        """Return the samples of a signal, a straight line where one was not measured; shape of ``time``."""
        values = self.recording[signal]
        finite = np.isfinite(values)
        if not finite.all():
            values = np.interp(self.recording.time, self.recording.time[finite], values[finite])
        return np.asarray(values[self.rows])

    def mean(self, signal: str, order: int = 0) -> Array:
        """Return each block's mean of a signal, weighted as a slope (1) or curvature (2) weighs its derivative."""
        weight = np.maximum(1.0 - self.tau**2, 0.0) ** order
        return np.asarray(np.sum(weight * self.values(signal), axis=1) / np.sum(weight, axis=1))

    def slope(self, signal: str) -> Array:
        """Return the slope of each block's line, per s."""
        return np.asarray(np.sum(self.values(signal) * self._line, axis=1) / self.half_duration)

    def curvature(self, signal: str) -> Array:
        """Return the second derivative of each block's parabola, per s^2."""
        return np.asarray(2.0 * np.sum(self.values(signal) * self._parabola, axis=1) / self.half_duration**2)

    def derivative_noise(self, order: int) -> float:
        """Return the noise of slopes (1) or curvatures (2) where that of the signal is 1 and white."""
        weights, scale = (
            (self._line, self.half_duration) if order == 1 else (self._parabola, 0.5 * self.half_duration**2)
        )
        return float(np.median(np.linalg.norm(weights, axis=1) / scale))

    @cached_property
    def _line(self) -> Array:
        return np.asarray(self.tau / np.sum(self.tau**2, axis=1, keepdims=True))

    @cached_property
    def _parabola(self) -> Array:
        """Weights whose sum with the samples is the factor of tau^2: tau^2 freed of its parts along 1 and tau."""
        square = self.tau**2
        free = square - square.mean(axis=1, keepdims=True)
        free -= np.sum(free * self.tau, axis=1, keepdims=True) * self._line
        return np.asarray(free / np.sum(free * square, axis=1, keepdims=True))


def resolved_blocks(recording: Recording, signal: str, order: int) -> Blocks | None:
    """Return the shortest blocks in which slopes (order 1) or curvatures (2) of ``signal`` stand clear of its noise.

    None where none do: the signal is too short, or does not move.
    """
    noise = max(recording.noise_rms(signal), 1e-9 * float(np.nanmax(np.abs(recording[signal]))), 1e-300)
    samples = int(np.count_nonzero(np.isfinite(recording[signal])))
    width = MIN_BLOCK_SAMPLES
    while samples // width >= MIN_BLOCKS:
        found = Blocks.cut(recording, signal, width)
        moved = found.slope(signal) if order == 1 else found.curvature(signal)
        if (
            found.count >= MIN_BLOCKS
            and float(np.std(moved)) > MIN_SIGNAL_TO_NOISE * found.derivative_noise(order) * noise
        ):
            return found
        width *= 2
    return None


@dataclass(frozen=True)
class LinearFit:
    """Factors of a linear fit with their standard errors, both of shape ``(columns,)``."""

    factors: Array
    errors: Array

    def combination(self, combination: Array) -> tuple[float, float]:
        """Return a combination of factors and its error, the errors taken as independent."""
        return float(combination @ self.factors), float(np.linalg.norm(combination * self.errors))


def fit_linear(columns: list[Array], target: Array) -> LinearFit | None:
    """Fit ``target`` by ``columns``, shape ``(n,)`` each, by least squares; None where there are too few.

    The jackknife over ``JACKKNIFE_GROUPS`` successive parts gives the errors: the residual is not white. Source:
    R. G. Miller, Biometrika 61 (1974).
    """
    if target.size < JACKKNIFE_GROUPS * (len(columns) + 1):
        return None
    design = np.column_stack(columns)
    scale = np.sqrt(np.mean(design**2, axis=0))
    if not np.all(scale > 0) or not np.all(np.isfinite(scale)):
        return None
    parts = list(
        zip(np.array_split(design / scale, JACKKNIFE_GROUPS), np.array_split(target, JACKKNIFE_GROUPS), strict=True)
    )
    squares = np.stack([d.T @ d for d, _ in parts])
    rights = np.stack([d.T @ t for d, t in parts])
    if not (np.isfinite(squares).all() and np.isfinite(rights).all()):
        return None
    whole = np.linalg.lstsq(squares.sum(axis=0), rights.sum(axis=0), rcond=1e-10)[0]
    left = [
        np.linalg.lstsq(squares.sum(axis=0) - s, rights.sum(axis=0) - r, rcond=1e-10)[0]
        for s, r in zip(squares, rights, strict=True)
    ]
    errors = np.sqrt(
        (JACKKNIFE_GROUPS - 1) / JACKKNIFE_GROUPS * np.sum((np.stack(left) - np.mean(left, axis=0)) ** 2, axis=0)
    )
    return LinearFit(whole / scale, errors / scale)


def prediction_errors(columns: list[Array], target: Array) -> Array:
    """Return the sums of squared errors of ``FOLDS`` parts of ``target``, each predicted from the others."""
    design, fold = np.column_stack(columns), np.arange(target.size) % FOLDS
    squares = []
    for n in range(FOLDS):
        fitted = np.linalg.lstsq(design[fold != n], target[fold != n], rcond=1e-10)[0]
        squares.append(np.sum((target[fold == n] - design[fold == n] @ fitted) ** 2))
    return np.array(squares)
