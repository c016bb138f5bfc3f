"""The noise of rows of steady flow, from the scatter between neighbouring rows of a path (Gasser et al., 1986)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array
from pneucli.identify.valve.steady_rows import FlowRows
from pneucli.physics.iso_flow import FlowCharacteristics, iso_mass_flow

SLOPE_STEP = 0.005  # of the upstream pressure, over which the slope of the curve is taken: it is infinite at r = 1
MIN_TRIPLES_BY_TERMS = {3: 20, 2: 8}  # neighbouring rows from which so many terms of the noise may be told
MIN_NOISE = 1e-4  # of the largest flow: finer than any flow meter
# of the largest upstream pressure: usual gauges repeat no better and no worse than this, which few rows can tell
MIN_PRESSURE_NOISE, MAX_PRESSURE_NOISE = 3e-4, 1e-3


@dataclass(frozen=True)
class NoiseLaw:
    """Standard deviation of the flow: sqrt(constant^2 + (relative q)^2 + (pressure dq/dp)^2).

    Attributes:
        constant: In kg/s.
        relative: Share of the flow.
        pressure: In Pa, of the pressures.
    """

    constant: float
    relative: float = 0.0
    pressure: float = 0.0


def flow_deviation(rows: FlowRows, path: FlowCharacteristics, law: NoiseLaw) -> Array:
    """Return the standard deviation of the flow of each row in kg/s: as stated in the pipeline, else by the law.

    Args:
        rows: The rows of a path.
        path: Its characteristics, which give the flow and its slope.
        law: The noise where the pipeline states none.

    Returns:
        Shape (n,), above 0.

    """
    flow, slope = _flow_and_slope(rows, path)
    stated, pressure = rows.stated_noise
    finest = MIN_PRESSURE_NOISE * float(rows.upstream.max())
    own = np.sqrt(stated**2 + (np.where(pressure > 0.0, pressure, finest) * slope) ** 2)
    read = np.clip(law.pressure, finest, MAX_PRESSURE_NOISE / MIN_PRESSURE_NOISE * finest)
    variance = law.constant**2 + (law.relative * flow) ** 2 + (read * slope) ** 2
    least = MIN_NOISE * float(np.max(np.abs(rows.flow)))
    return np.asarray(np.maximum(np.where(stated > 0.0, own, np.sqrt(variance)), least))


def _flow_and_slope(rows: FlowRows, path: FlowCharacteristics) -> tuple[Array, Array]:
    """Return the flow in kg/s of each row, and its slope over the downstream pressure in kg/(s Pa), each (n,)."""
    step = SLOPE_STEP * rows.upstream
    flow, below, above = (
        iso_mass_flow(path, rows.upstream, rows.downstream + side * step, rows.temperature) for side in (0, -1, 1)
    )
    return flow, np.abs(above - below) / (2 * step)


def fit_noise_law(groups: Sequence[FlowRows], paths: Sequence[FlowCharacteristics]) -> NoiseLaw:
    """Estimate the noise law of rows from their residuals.

    Each residual is compared with the straight line between its two neighbours over the pressure ratio (Gasser, Sroka
    and Jennen-Steinmetz, Biometrika 73 (1986) 625), so that a smooth lack of fit does not count as noise.

    Args:
        groups: The rows of each path.
        paths: The fitted characteristics of each.

    Returns:
        The law: constant alone where fewer than 8 triples of rows are known, without the pressure below 20.

    """
    squares, terms, plain = [], [], []
    for rows, path in zip(groups, paths, strict=True):
        order = np.argsort(rows.ratio, kind="stable")
        flow, slope = _flow_and_slope(rows, path)
        residual = (rows.flow - flow)[order]
        plain.append(residual)
        if residual.size < 3:
            continue
        r = rows.ratio[order]
        width = r[2:] - r[:-2]
        share = np.where(width > 0.0, (r[1:-1] - r[:-2]) / np.where(width > 0.0, width, 1.0), 0.5)
        pseudo = residual[1:-1] - (1 - share) * residual[:-2] - share * residual[2:]
        squares.append(pseudo**2 / (1.0 + share**2 + (1 - share) ** 2))
        terms.append(np.column_stack([np.ones(pseudo.size), flow[order][1:-1] ** 2, slope[order][1:-1] ** 2]))
    largest = max(float(np.max(np.abs(rows.flow), initial=0.0)) for rows in groups)
    if not squares:
        freedom = max(sum(one.size for one in plain) - 3, 1)
        return NoiseLaw(max(float(np.sqrt(sum(one @ one for one in plain) / freedom)), MIN_NOISE * largest))
    y, x = np.concatenate(squares), np.concatenate(terms)
    terms_told = next((n for n, least in MIN_TRIPLES_BY_TERMS.items() if y.size >= least), 1)
    return _weighted_law(y, x[:, :terms_told], largest)


def _weighted_law(y: Array, x: Array, largest: float) -> NoiseLaw:
    """Return the law whose variance follows squared residuals (n,); a square scatters as its own expectation."""
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import, and few pipelines have a flow bench

    size = np.maximum(np.sqrt(np.mean(x**2, axis=0)), 1e-300)
    expected = np.full(y.size, max(float(np.mean(y)), (MIN_NOISE * largest) ** 2))
    least, parts = (MIN_NOISE * largest) ** 2, np.zeros(x.shape[1])
    for _ in range(4):
        parts = nnls(x / size / expected[:, None], y / expected)[0] / size
        expected = np.maximum(x @ parts, 0.05 * float(np.mean(y)) + least)
    constant, relative, pressure = [*np.sqrt(parts).tolist(), 0.0, 0.0][:3]
    return NoiseLaw(max(constant, MIN_NOISE * largest), relative, pressure)
