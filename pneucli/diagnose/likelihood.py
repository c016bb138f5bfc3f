"""The likelihood of residuals of a model that is never quite right: noise, and a discrepancy in every octave.

A residual's time is cut into octaves by Haar's orthonormal wavelets. In each octave of a channel its coefficients are
normal with one variance, that of the sensors' noise at least: what exceeds it is the model's discrepancy, of whatever
size and time constant the data show. So a slow error counts as few independent readings and a fast one as many, and a
model that leaves less where much is left anyway gains little by it. Sources: M. Kennedy, A. O'Hagan, J. R. Stat. Soc. B
63 (2001) 425, for the discrepancy; G. Wornell, A. Oppenheim, IEEE Trans. Signal Process. 40 (1992) 611, for wavelets of
coloured noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.fit import block_numbers
from pneucli.identify.views import View

Array = NDArray[np.float64]
Kind = tuple[type[View], str, int, int]  # view, channel, rate, octave: what has one variance


@dataclass(frozen=True)
class Detail:
    """The squares (m,) of one channel's coefficients in one octave, and the block in which each stands (m,)."""

    kind: Kind
    squares: Array
    blocks: NDArray[np.int64]


def deviance(views: Sequence[View], residual: Array, errors: Sequence[Mapping[str, Array]]) -> Array:
    """Return -2 log L of residuals (N,) in units of the sensors' noise, by block; of noise alone it is their number.

    Samples at which the model states nothing (zeros) count as noise, and so does what is less than noise: a model that
    smooths it gains nothing. ``errors`` of the starts add their volume.
    """
    blocks, details = block_numbers(views), list(_details(views, residual))
    variances = _variances(details)
    volume = np.concatenate([view.volume(mine) for view, mine in zip(views, errors, strict=True)])
    out = np.bincount(blocks, (residual == 0.0) + volume).astype(np.float64)
    for d in details:
        variance, lacking = variances[d.kind], max(1.0 - float(np.mean(d.squares)), 0.0)
        out += np.bincount(d.blocks, (d.squares + lacking) / variance + np.log(variance), minlength=out.size)
    return out


def _variances(details: Sequence[Detail]) -> dict[Kind, float]:
    """Return the variance of each kind of coefficient over that of the sensors' noise, at least 1."""
    pooled: dict[Kind, list[Array]] = {}
    for d in details:
        pooled.setdefault(d.kind, []).append(d.squares)
    return {kind: max(float(np.mean(np.concatenate(parts))), 1.0) for kind, parts in pooled.items()}


def _details(views: Sequence[View], residual: Array) -> Iterator[Detail]:
    blocks, first = block_numbers(views), 0
    for view in views:
        for channel in view.channels:
            part = slice(first, first + view.experiment.time.size)
            first = part.stop
            seen, rate = np.flatnonzero(residual[part]), _rate(view)
            for octave, values in enumerate(octaves(residual[part][seen])):
                middle = np.minimum((2 * np.arange(values.size) + 1) << octave, seen.size - 1)
                yield Detail((type(view), channel, rate, octave), values**2, blocks[part][seen[middle]])


def _rate(view: View) -> int:
    """Return the sampling rate in eighths of an octave: clocks that differ by less have the same."""
    time = view.experiment.time
    return round(-8.0 * float(np.log2(np.median(np.diff(time))))) if time.size > 1 else 0


def octaves(values: Array) -> list[Array]:
    """Return Haar's coefficients of values (n,), the finest octave first, the last what is left of all means."""
    found = []
    while values.size > 1:
        pairs = values[: values.size // 2 * 2].reshape(-1, 2)
        found.append((pairs[:, 0] - pairs[:, 1]) / np.sqrt(2.0))
        values = np.append((pairs[:, 0] + pairs[:, 1]) / np.sqrt(2.0), values[pairs.size :])
    return [*found, values] if values.size else found
