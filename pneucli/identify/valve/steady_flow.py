"""ISO 6358-1 on a steady bench: C, b, m and the cracking pressure of each flow path from rows of flow and pressures.

A weighted least squares fit on the flow. The weights come from the scatter between neighbouring rows of a path, and
the intervals from the residuals, so that they cover lack of fit and not only the noise of the sensors.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneucli.arrays import Array
from pneucli.distributions import f_tail, student_t_quantile
from pneucli.figure import Figure
from pneucli.identify.valve.iso6358 import TYPICAL_B_M, TYPICAL_B_M_SPREAD
from pneucli.identify.valve.steady_rows import (
    FlowPath,
    FlowRows,
    NoiseLaw,
    characteristics_at,
    coordinates_of,
    fit_noise_law,
    flow_deviation,
)
from pneucli.physics.iso_flow import FlowCharacteristics, iso_mass_flow
from pneucli.quantities import Z95

BOUNDS = (np.array([-7.0, 0.0, 0.2]), np.array([7.0, 0.9, 1.5]))  # of log C from its start, of b, of m
MIN_GAIN = 12.0  # F of one parameter more: exceeded by chance in 1 of 1,000 with 15 rows and more
MIN_CRACKING_SHARE = 0.005  # of the upstream pressure: a smaller difference is one of the gauges' zeros
MIN_CRACKING_ROWS = 5  # rows of a path from which a cracking pressure may be told
NOISE_ROUNDS = 3  # fits, each with the noise law of the residuals before
MAX_CHANCE = 0.01  # that a path scatters as much more than the others as it does
MAX_LACK_OF_FIT = 9.0  # mean square residual over that of the noise, of rows that follow the curve
MIN_SUBSONIC_ROWS, MIN_SUBSONIC_SHARE = 2, 0.1  # rows, and of the range from b to 1, beyond choked flow
MAX_ERROR_RATIO = 0.5  # of the typical spread: a larger standard error means that the rows do not determine b or m
START_NOISE = 0.02  # of the largest flow
DERIVATIVE_STEP = 1e-5


@dataclass(frozen=True)
class _Fit:
    z: Array  # log C, b, m, cracking pressure in units of the largest upstream pressure
    free: tuple[int, ...]
    cost: float
    jacobian: Array
    abrupt: bool


def fit_flow_paths(groups: Sequence[FlowRows]) -> tuple[list[FlowPath], NoiseLaw]:
    """Fit C, b, m, and the cracking pressure where the rows show one, to each path that has a flow.

    b and m have the typical values of industrial valves as a weak prior, which holds them where the rows do not
    determine them. A cracking pressure is fitted where it improves the fit significantly.

    Args:
        groups: The rows of each path.

    Returns:
        The paths, in the order of ``groups``, those without any flow left out; and the noise of the rows.

    References:
        ISO 6358-1:2013, 5 and annex; ISO 6358-1:2013/Amd 2.

    """
    groups = [rows for rows in groups if np.max(rows.flow, initial=0.0) > 0.0]
    if not groups:
        return [], NoiseLaw(0.0)
    law = NoiseLaw(constant=START_NOISE * max(float(rows.flow.max()) for rows in groups))
    fits: list[_Fit] = []
    for _ in range(NOISE_ROUNDS):
        fits = [_select(rows, law) for rows in groups]
        paths = [_path_at(rows, one) for rows, one in zip(groups, fits, strict=True)]
        law = fit_noise_law(groups, paths)
    return _with_intervals(groups, fits, law), law


def refit(path: FlowPath, rows: FlowRows, law: NoiseLaw) -> FlowCharacteristics:
    """Fit other readings of the same rows, with a cracking pressure where the path has one.

    Args:
        path: The path as fitted.
        rows: The other readings.
        law: The noise of the rows.

    Returns:
        The characteristics that they show.

    """
    cracking = () if path.cracking is None else (path.characteristics.cracking_pressure / _scale(rows),)
    return _path_at(rows, _fit(rows, law, cracking, abrupt=path.characteristics.opens_abruptly))


def _scale(rows: FlowRows) -> float:
    return float(rows.upstream.max())


def _path_at(rows: FlowRows, fit: _Fit) -> FlowCharacteristics:
    z = fit.z.copy()
    z[3] *= _scale(rows)
    return characteristics_at(z, abrupt=fit.abrupt)


def _select(rows: FlowRows, law: NoiseLaw) -> _Fit:
    """Return the fit without a cracking pressure, or with one where that is significantly better."""
    plain = _fit(rows, law, ())
    if rows.flow.size < MIN_CRACKING_ROWS:
        return plain
    difference = (rows.upstream - rows.downstream) / _scale(rows)
    shut = rows.flow <= 0.01 * rows.flow.max()
    highest_shut = float(np.max(difference[shut & (difference > 0)], initial=0.0))
    lowest_open = float(np.min(difference[~shut], initial=1.0))
    starts = {max(s, 1e-3) for s in (highest_shut, 0.5 * lowest_open, 0.5 * (highest_shut + lowest_open))}
    tried = [_fit(rows, law, (start,)) for start in sorted(starts)]
    edge = 0.5 * (highest_shut + lowest_open)
    if 0.0 < highest_shut < lowest_open:  # rows shut below, and open above: where it opens abruptly, in between
        tried.append(_fit(rows, law, (edge,), abrupt=True))
    best = min(tried, key=lambda one: one.cost)
    rest = max(rows.flow.size - 4, 1)
    gain = (plain.cost - best.cost) / max(best.cost / rest, 1e-300)
    shows = gain > MIN_GAIN and best.z[3] > MIN_CRACKING_SHARE
    return best if shows else plain


def _fit(rows: FlowRows, law: NoiseLaw, cracking: tuple[float, ...], *, abrupt: bool = False) -> _Fit:
    """Fit log C, b, m and, unless the path opens abruptly at a given difference, the cracking pressure."""
    from scipy.optimize import least_squares  # noqa: PLC0415 - slow to import, and few pipelines have a flow bench

    scale = _scale(rows)
    at = cracking[0] if cracking else 0.0
    start = np.array([np.log(_start_conductance(rows, at * scale)), *TYPICAL_B_M, at])
    free = (0, 1, 2, 3) if cracking and not abrupt else (0, 1, 2)

    def at_coordinates(x: Array) -> tuple[Array, FlowCharacteristics]:
        z = start.copy()
        z[list(free)] = x
        return z, characteristics_at(np.array([*z[:3], z[3] * scale]), abrupt=abrupt)

    def residuals(x: Array) -> Array:
        z, path = at_coordinates(x)
        flow = iso_mass_flow(path, rows.upstream, rows.downstream, rows.temperature)
        return np.concatenate([(flow - rows.flow) / deviation, (z[1:3] - TYPICAL_B_M) / TYPICAL_B_M_SPREAD])

    deviation = flow_deviation(rows, at_coordinates(start[list(free)])[1], law)
    shift = np.array([start[0], 0.0, 0.0])
    low, high = (np.append(end + shift, last)[list(free)] for end, last in zip(BOUNDS, (0.0, 0.95), strict=True))
    bounds = (low, high)
    x = np.clip(start[list(free)], bounds[0] + 1e-9, bounds[1] - 1e-9)
    for _ in range(2):  # the noise of a pressure moves the flow by the slope of the curve, which the fit finds
        found = least_squares(residuals, x, bounds=bounds, x_scale=np.array([0.1, 0.1, 0.1, 0.05])[list(free)])
        x = found.x
        z, path = at_coordinates(x)
        deviation = flow_deviation(rows, path, law)
    residual = residuals(x)
    jacobian = np.array([_slope(residuals, x, i, bounds) for i in range(x.size)]).T
    return _Fit(z, free, float(residual @ residual), jacobian, abrupt)


def _start_conductance(rows: FlowRows, cracking: float) -> float:
    """Return the conductance that rows have at typical b and m; of rows without a pressure difference, if choked."""
    typical = FlowCharacteristics(1.0, float(TYPICAL_B_M[0]), float(TYPICAL_B_M[1]), cracking)
    unit = iso_mass_flow(typical, rows.upstream, rows.downstream, rows.temperature)
    used = (rows.flow > 0.1 * rows.flow.max()) & (unit > 1e-3 * unit.max()) & (unit > 0.0)
    if not used.any():
        choked = iso_mass_flow(FlowCharacteristics(1.0), rows.upstream, 0.0 * rows.upstream, rows.temperature)
        return float(np.max(rows.flow / choked))
    return float(np.median(rows.flow[used] / unit[used]))


def _slope(residuals: Callable[[Array], Array], x: Array, i: int, bounds: tuple[Array, Array]) -> Array:
    """Return the derivative of residuals by coordinate i, one-sided at a bound."""
    ends = []
    for side in (1.0, -1.0):
        moved = x.copy()
        moved[i] = np.clip(x[i] + side * DERIVATIVE_STEP, bounds[0][i], bounds[1][i])
        ends.append(moved)
    up, down = ends
    return np.asarray((residuals(up) - residuals(down)) / (up[i] - down[i]))


def _with_intervals(groups: Sequence[FlowRows], fits: Sequence[_Fit], law: NoiseLaw) -> list[FlowPath]:
    """Return the paths with intervals: of the common scatter, or of a path's own where that is larger for certain."""
    determined = [_determined(one, rows) for one, rows in zip(fits, groups, strict=True)]
    lost = [1 + sum(d) + (3 in one.free) for d, one in zip(determined, fits, strict=True)]
    degrees = [max(rows.flow.size - n, 0) for rows, n in zip(groups, lost, strict=True)]
    total = max(sum(degrees), 1)
    pooled = max(sum(one.cost for one, d in zip(fits, degrees, strict=True) if d) / total, 1.0)
    found = []
    for rows, one, known, own in zip(groups, fits, determined, degrees, strict=True):
        variance, freedom = pooled, total
        if own and f_tail(one.cost / own / pooled, own, total) < MAX_CHANCE:
            variance, freedom = one.cost / own, own
        found.append(_path(rows, one, known, variance, float(student_t_quantile(0.975, freedom)), law))
    return found


def _inverse_information(fit: _Fit, variance: float) -> Array:
    """Return the covariance of the free coordinates; the prior keeps its own size, whatever the rows' scatter."""
    data, prior = fit.jacobian[:-2], fit.jacobian[-2:]
    return np.asarray(np.linalg.pinv(data.T @ data / variance + prior.T @ prior, hermitian=True))


def _determined(fit: _Fit, rows: FlowRows) -> tuple[bool, bool]:
    """Return whether the rows, and not the prior, determine b and m: it takes two rows beyond choked flow."""
    b = float(fit.z[1])
    if np.count_nonzero(rows.ratio > b + MIN_SUBSONIC_SHARE * (1.0 - b)) < MIN_SUBSONIC_ROWS:
        return False, False
    error = np.sqrt(np.diag(_inverse_information(fit, 1.0)))[1:3]
    known = (error < MAX_ERROR_RATIO * TYPICAL_B_M_SPREAD).tolist()
    return known[0], known[1]


def _path(
    rows: FlowRows, fit: _Fit, known: tuple[bool, bool], variance: float, quantile: float, law: NoiseLaw
) -> FlowPath:
    scale = _scale(rows)
    covariance = np.zeros((4, 4))
    covariance[np.ix_(fit.free, fit.free)] = _inverse_information(fit, variance)
    units = np.array([1.0, 1.0, 1.0, scale])
    covariance *= np.outer(units, units)
    path = _path_at(rows, fit)
    half = quantile * np.sqrt(np.diag(covariance))
    c, lack = path.sonic_conductance, fit.cost / max(rows.flow.size - 4, 1)
    ends = (np.zeros(4), np.array([np.inf, 1.0, np.inf, np.inf]))
    b, m, cracking = (
        Figure(v, max(v - half[i], ends[0][i]), min(v + half[i], ends[1][i]))
        for i, v in enumerate(coordinates_of(path)[1:], 1)
    )
    if not any(known):  # choked rows exclude a small b, and leave every larger one
        typical = TYPICAL_B_M + Z95 * TYPICAL_B_M_SPREAD
        b, m = (replace(one, high=max(one.high, float(end))) for one, end in zip((b, m), typical, strict=True))
    return FlowPath(
        rows=rows,
        characteristics=path,
        C=Figure(c, c * float(np.exp(-half[0])), c * float(np.exp(half[0]))),
        b=replace(b, determined=known[0]),
        m=replace(m, determined=known[1]),
        cracking=_cracking(rows, fit, cracking, follows=lack < MAX_LACK_OF_FIT),
        covariance=covariance,
        quantile=quantile,
        deviation=flow_deviation(rows, path, law),
    )


def _cracking(rows: FlowRows, fit: _Fit, fitted: Figure, *, follows: bool) -> Figure | None:
    """Return the cracking pressure: as fitted, or between the rows that are shut and open.

    The latter holds where the path opens abruptly, and where its rows do not follow the curve.
    """
    if fitted.value <= 0.0 or not (fit.abrupt or 3 in fit.free):
        return None
    difference, shut = rows.upstream - rows.downstream, rows.flow <= 0.01 * rows.flow.max()
    low = float(np.max(difference[shut & (difference > 0.0)], initial=0.0))
    high = float(np.min(difference[~shut], initial=np.inf))
    if (follows and not fit.abrupt) or not low < high:
        return fitted
    return Figure(0.5 * (low + high), low, high)
