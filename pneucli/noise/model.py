"""The noise of a sensor: white and coloured noise, mains hum, quantisation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dtbtrs

from pneucli.arrays import Array

STANDARD_ERRORS = 2.0  # of a 95 % interval
NORMAL_MAD = 1.4826  # standard deviation over median absolute value, of a normal distribution


@dataclass(frozen=True)
class NoiseModel:
    """White and first-order coloured noise, sinusoidal lines and quantisation, in the unit of the signal.

    Attributes:
        white: Standard deviation of the white part.
        coloured: Standard deviation of the coloured part.
        pole: AR(1) coefficient of the coloured part per ``period``.
        period: Sampling period in s.
        lines: Pairs of frequency in Hz and amplitude.
        step: Quantisation step; 0: none.
        interval: Least and most rms of white and coloured noise that the recording leaves possible (95 %); None where
            they are stated, or absent.
    """

    white: float
    coloured: float = 0.0
    pole: float = 0.0
    period: float = 1e-3
    lines: tuple[tuple[float, float], ...] = ()
    step: float = 0.0
    interval: tuple[float, float] | None = None

    @property
    def rms(self) -> float:
        """Root mean square of all parts, at least step / sqrt(12) (interface, section 3).

        >>> NoiseModel(white=3.0, coloured=4.0).rms
        5.0
        """
        return self._with_lines_and_step(float(np.hypot(self.white, self.coloured)))

    @property
    def rms_interval(self) -> tuple[float, float] | None:
        """Least and most :attr:`rms` that the recording leaves possible (95 %); None where it is not estimated.

        >>> NoiseModel(white=1.0, step=34.7, interval=(0.1, 11.0)).rms_interval  # doctest: +ELLIPSIS
        (10.01702..., 11.0)
        """
        return None if self.interval is None else tuple(map(self._with_lines_and_step, self.interval))  # type: ignore[return-value]

    @property
    def relative_error(self) -> float:
        """Standard error of :attr:`rms` over it, from the logarithm of the interval's ends; 0 where it is stated.

        >>> round(NoiseModel(white=1.0, interval=(0.8, 1.25)).relative_error, 3)
        0.112
        """
        if self.rms_interval is None or not self.rms_interval[0] > 0.0:
            return 0.0
        low, high = self.rms_interval
        return math.log(high / low) / (2.0 * STANDARD_ERRORS)

    def _with_lines_and_step(self, rms: float) -> float:
        power = rms**2 + sum(a * a / 2 for _, a in self.lines)
        return float(max(np.sqrt(power), self.step / np.sqrt(12)))

    def draw(self, time: Array, rng: np.random.Generator) -> Array:
        """Draw one realisation.

        Args:
            time: Time stamps in s, taken as equidistant, shape (n,).
            rng: Generator of random numbers.

        Returns:
            Noise, shape (n,).
        """
        n = time.size
        white = max(self.white, 0.0 if self.coloured or self.lines else self.rms)
        noise = white * rng.standard_normal(n)
        if self.coloured:
            innovations = np.sqrt(1 - self.pole**2) * rng.standard_normal(n)
            state = self.pole * rng.standard_normal()
            innovations[0] += state
            recursion = np.vstack([np.ones(n), np.full(n, -self.pole)])  # y_k - pole y_(k-1) = innovation, by diagonals
            noise += self.coloured * dtbtrs(recursion, innovations, uplo="L", diag="U")[0]
        for frequency, amplitude in self.lines:
            noise += amplitude * np.sin(2 * np.pi * (frequency * time + rng.random()))
        return np.asarray(noise, dtype=np.float64)
