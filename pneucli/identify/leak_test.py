"""The leak of a shut vessel from its pressure: rate with interval, law, and what temperature may have done.

The gas leaves by ``p^2 - p_amb^2 = a q + b q^2``: a laminar gap is the limit b = 0, an orifice the limit a = 0. Its
temperature comes to that of the wall after filling (an exponential), and the wall drifts by what is stated.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import OptimizeResult, least_squares

from pneucli.arrays import Array
from pneucli.figure import Figure
from pneucli.identify.leaking_vessel import leak_share, vessel_pressure
from pneucli.noise import NORMAL_MAD
from pneucli.noise.estimate import quantisation_step

BLOCKS = 300  # stretches of a recording, each of which counts as one reading
MIN_BLOCKS = 20  # of the shut stretch, below which its shape says nothing
SMOOTH = 5  # blocks of the median that takes single glitches away
HELD_BETTER = 1.5  # times less square of the deviations: a level was held before it fell
EVENT = 6.0  # standard deviations of a block's change that are no noise
WARMED = 0.15  # standard deviation of the gas' first temperature over the wall's: half of what filling can heat it
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the laminar part in the first pressure drop
SETTLINGS = (-1.0, 1.0)  # logarithms of the time constant over that of natural convection, from which a fit begins
DENSITY = (2.0 / 3.0, 1.0 / 3.0)  # power of the density in the heat transfer to the wall, and its standard deviation
DIFFERENCE = (1.0 / 6.0, 1.0 / 6.0)  # the same of the temperatures' difference: between forced and natural convection
SCALES = (0.01, 1e-3, 0.05, 1e-4, 1.0, 0.3, 0.2)  # of the parameters of a fit
SPREAD, SPREAD_UNKNOWN = 1.0, 2.0  # of its logarithm, with the volume stated and not
STARTS = (0.0, 0.05, 0.1, 0.2, 0.35, 0.5)  # of the shut stretch, at which the fit may begin
WORSE = 1.3  # times the least misfit of all starts that is as good
LAW_ERROR = 0.003  # of the pressure's change, up to which laws of leak and heat transfer are taken for true
MAX_FITS = 60  # evaluations of a fit
CHI_95 = 3.84  # quantile of chi-square with one degree of freedom
MANY_TIMES = 2.0 * math.log(20.0)  # of twice the log-likelihood: one law is 20 times as likely as the other
TABLE = 2000  # points of a law's clock


@dataclass(frozen=True)
class Stretch:
    """Samples ``start`` to ``stop`` in which the vessel is shut, and the samples before in which it rests."""

    start: int
    stop: int
    rest: int


@dataclass(frozen=True)
class LeakFit:
    """A leak of a shut vessel.

    Attributes:
        start: Time in s at which the fit begins.
        pressure: Pressure in Pa there, at which ``rate`` holds.
        rate: Loss of pressure in Pa/s at the wall's temperature; negative where pressure moves away from ambient.
        drift: Half of the interval's width that an unknown drift of the wall makes, Pa/s.
        laminar: Share of the laminar part in the pressure drop there.
        law: ``laminar``, ``orifice``, ``between`` or ``cannot tell``.
        warmed: How much warmer than the wall the gas is at first, K.
        settling: Time constant in s with which it comes to the wall's temperature.
        misfit: Deviation of the blocks' means over their noise.
        curve: Times in s, pressures as measured and of the model, shape (n, 3).
    """

    start: float
    pressure: float
    rate: Figure
    drift: float
    laminar: float
    law: str
    warmed: float
    settling: float
    misfit: float
    curve: Array


def shut_stretch(p: Array, ambient: float, command: Array | None = None) -> Stretch | None:
    """Find where a vessel loses pressure by itself: toward ambient, ever slower, the valve's command unchanged.

    Args:
        p: Pressure in Pa, absolute, shape (n,).
        ambient: Ambient pressure in Pa.
        command: Command of the valve, shape (n,).

    Returns:
        The longest stretch of this kind; None where there is none away from ambient.

    """
    edges = np.linspace(0, p.size, min(BLOCKS, p.size) + 1).astype(int)
    level = np.array([np.nanmean(p[a:b]) for a, b in pairwise(edges)])
    away = median_filter(np.abs(level - ambient), SMOOTH, mode="nearest")  # keeps edges, and no single glitch
    noise = max(_scatter(level, ambient), quantisation_step(p) / math.sqrt(12.0))
    loss = -np.diff(away)
    loss_before = np.concatenate([[loss[0]], loss[:-1]])
    broken = (loss < -EVENT * noise) | (loss > 2.0 * np.maximum(loss_before, 0.0) + EVENT * noise)
    if command is not None:
        commanded = np.array([np.nanmedian(command[a:b]) for a, b in pairwise(edges)])
        broken |= np.abs(np.diff(commanded)) > 0.05 * max(float(np.ptp(commanded)), 1e-12)
    cuts = [0, *(int(i) + 1 for i in np.flatnonzero(broken)), level.size]
    whole = [(a, b) for a, b in pairwise(cuts) if b - a >= 2]
    usable = [(a, b) for a, b in whole if np.mean(away[a:b]) > max(0.05 * away.max(), EVENT * noise)]
    if not usable:
        return None
    a, b = max(usable, key=lambda one: one[1] - one[0])
    if (held := _held(away[a:b])) > 0:
        return Stretch(int(edges[a + held]), int(edges[b]), int(edges[a]))
    rest = next((first for first, last in whole if last == a and np.ptp(level[first:last]) < 0.01 * away.max()), a)
    return Stretch(int(edges[a]), int(edges[b]), int(edges[rest]))


def _held(level: Array) -> int:
    """Return for how many blocks a level is held before it falls: 0 where a smooth course describes it as well."""
    number = np.arange(level.size, dtype=np.float64)
    smooth = float(np.sum((level - np.polyval(np.polyfit(number, level, 2), number)) ** 2))
    best, held = smooth / HELD_BETTER, 0
    for k in range(MIN_BLOCKS // 2, level.size - MIN_BLOCKS // 2):
        hinge = np.column_stack([np.ones(level.size), np.maximum(number - k, 0.0)])
        left = level - hinge @ np.linalg.lstsq(hinge, level, rcond=None)[0]
        if (rest := float(left @ left)) < best:
            best, held = rest, k
    return held


def _scatter(level: Array, ambient: float) -> float:
    """Return the standard deviation of the changes of blocks' means about their slow course."""
    change = np.diff(np.abs(level - ambient))
    return float(NORMAL_MAD * np.median(np.abs(change - median_filter(change, 3 * SMOOTH, mode="nearest"))))


def _block_noise(level: Array) -> float:
    """Return the standard deviation of blocks' means from their second differences, which no slow course moves."""
    return float(NORMAL_MAD * np.median(np.abs(np.diff(level, 2))) / math.sqrt(6.0)) if level.size > 2 else 0.0


def fit_leak(
    time: Array,
    p: Array,
    ambient: float,
    *,
    temperature: float,
    volume: float | None = None,
    drift: float = 0.1,
    kappa: float = 1.4,
) -> LeakFit:
    """Fit the leak of a shut vessel.

    Args:
        time: Times in s, shape (n,).
        p: Pressure in Pa, absolute, of a shut vessel, shape (n,), no NaN; ``n >= MIN_BLOCKS``.
        ambient: Ambient pressure in Pa.
        temperature: Temperature of the wall in K.
        volume: Volume in m^3, from which follows how long gas takes to come to the wall's temperature.
        drift: Standard uncertainty in K of the change of the wall's temperature over the test.
        kappa: Ratio of the gas' heat capacities.

    Returns:
        The leak, fitted from the earliest start from which the model holds as well as from any.

    """
    edges = np.linspace(0, p.size, min(BLOCKS, p.size) + 1).astype(int)
    pairs = list(pairwise(edges))
    times, means = (np.array([float(np.mean(values[a:b])) for a, b in pairs]) for values in (time, p))
    fine = max(_block_noise(means), quantisation_step(p) / math.sqrt(12.0) / math.sqrt(max(p.size / means.size, 1.0)))
    noise = math.hypot(fine, LAW_ERROR * float(np.ptp(means))) or 1.0
    firsts = [int(share * means.size) for share in STARTS if means.size * (1.0 - share) >= MIN_BLOCKS]
    tests = [_Test(times[i:], means[i:], ambient, temperature, volume, drift, kappa) for i in firsts or [0]]
    coarse = [one.misfit(noise) for one in tests]
    chosen = next(one for one, misfit in zip(tests, coarse, strict=True) if misfit <= WORSE * max(min(coarse), 1.0))
    return chosen.fit(noise * chosen.inflation(noise))


@dataclass(frozen=True)
class _Node:
    """A fit with one law.

    ``deviation`` is that of the rate, ``own`` as if the wall's temperature were known; ``theta`` holds the first
    pressure and the rate over the reference pressure, how much warmer than the wall the gas is at first, the wall's
    drift (both over its temperature), the logarithm of the settling time, and the powers of the heat transfer.
    """

    share: float
    cost: float
    misfit: float
    deviation: float
    own: float
    theta: Array
    model: Array


class _Test:
    """Means of blocks of one shut stretch, ready to be fitted."""

    def __init__(
        self,
        time: Array,
        p: Array,
        ambient: float,
        temperature: float,
        volume: float | None,
        drift: float,
        kappa: float,
    ) -> None:
        self.time, self.p = time - time[0], p
        self.start, self.temperature, self.kappa = float(time[0]), temperature, kappa
        self.reference = float(np.mean(p[:3]))
        self.ambient = ambient / self.reference
        settling = math.log(settling_time(self.reference, volume, temperature))
        self.centre = np.array([1.0, 0.0, 0.0, 0.0, settling, DENSITY[0], DIFFERENCE[0]])
        spread = SPREAD if volume else SPREAD_UNKNOWN
        drifted = max(drift / temperature, 1e-9)
        self.weight = 1.0 / np.array([math.inf, math.inf, WARMED, drifted, spread, DENSITY[1], DIFFERENCE[1]])

    def inflation(self, noise: float) -> float:
        """Return how much larger than ``noise`` deviations count: the misfit, and how alike neighbours deviate."""
        best = _best(self.nodes(noise))
        left = self.p - best.model
        likeness = float(np.clip(np.sum(left[1:] * left[:-1]) / max(float(np.sum(left**2)), 1e-300), 0.0, 0.98))
        return math.sqrt(max(best.misfit**2, 1.0) * (1.0 + likeness) / (1.0 - likeness))

    def misfit(self, noise: float) -> float:
        """Return the least misfit of the laws' limits."""
        return min(node.misfit for share in (SHARES[0], SHARES[-1]) for node in self.node(share, noise))

    def nodes(self, noise: float) -> list[_Node]:
        """Return the fits with each law, from each first settling time."""
        return [node for share in SHARES for node in self.node(share, noise)]

    def fit(self, noise: float) -> LeakFit:
        """Fit the leak with means of this standard deviation in Pa."""
        nodes = self.nodes(noise)
        best = _best(nodes)
        near = [n for n in nodes if n.cost < best.cost + CHI_95]
        reach = [(n.theta[1], n.deviation * math.sqrt(CHI_95 - n.cost + best.cost)) for n in near]
        low, high = min(rate - half for rate, half in reach), max(rate + half for rate, half in reach)
        return LeakFit(
            start=self.start,
            pressure=self.reference,
            rate=Figure(
                float(best.theta[1]) * self.reference, float(low) * self.reference, float(high) * self.reference
            ),
            drift=self.reference * math.sqrt(CHI_95 * max(best.deviation**2 - best.own**2, 0.0)),
            laminar=best.share,
            law=self._law(nodes, (low, high)),
            warmed=float(best.theta[2]) * self.temperature,
            settling=math.exp(best.theta[4]),
            misfit=best.misfit,
            curve=np.column_stack([self.start + self.time, self.p, best.model]),
        )

    def _law(self, nodes: Sequence[_Node], interval: tuple[float, float]) -> str:
        """Return which limit of the law holds, where one is many times as likely as the other."""
        costs = {share: min(n.cost for n in nodes if n.share == share) for share in SHARES}
        able = [share for share, cost in costs.items() if cost < min(costs.values()) + MANY_TIMES]
        if interval[0] <= 0.0 <= interval[1] or {SHARES[0], SHARES[-1]} <= set(able):
            return "cannot tell"
        return "laminar" if SHARES[-1] in able else "orifice" if SHARES[0] in able else "between"

    def node(self, share: float, noise: float) -> list[_Node]:
        """Return the fits with one law."""
        begin = self.centre.copy()
        begin[:2] = self.p[0] / self.reference, self._first_rate(share)
        room = 30.0 * abs(begin[1]) + 1e3 * noise / self.reference / self.time[-1]
        reach = np.array([0.2, room, 0.35, 0.1, 4.0, 1.0, 0.5])

        def deviations(theta: Array) -> Array:
            start, rate, warmed, drift, settling, density, difference = theta
            gas = (self.ambient, share, rate, math.exp(settling), density, difference, self.kappa)
            relative = vessel_pressure(self.time, start, warmed, drift, *gas)  # type: ignore[no-untyped-call]
            return np.concatenate([(relative * self.reference - self.p) / noise, (theta - self.centre) * self.weight])

        fits = [
            least_squares(
                deviations, begin + shift, bounds=(begin - reach, begin + reach), x_scale=SCALES, max_nfev=MAX_FITS
            )
            for shift in np.outer(SETTLINGS, np.arange(7) == 4)
        ]
        return [self._fitted(share, found, noise) for found in fits]

    def _fitted(self, share: float, found: OptimizeResult, noise: float) -> _Node:
        misfit = found.fun[: self.time.size]
        return _Node(
            share,
            2.0 * float(found.cost),
            float(np.sqrt(np.mean(misfit**2))),
            _deviation(found.jac),
            _deviation(np.delete(found.jac, 3, axis=1)),  # as if the wall did not drift
            found.x,
            self.p + misfit * noise,
        )

    def _first_rate(self, share: float) -> float:
        """Return the rate at the reference pressure that the middle of the way to ambient tells."""
        away = np.abs(self.p / self.reference - self.ambient)
        far = max(int(np.flatnonzero(away > 0.1 * away[0])[-1]), 3)
        middle = slice(far // 3, 2 * far // 3 + 2)
        slope = float(np.polyfit(self.time[middle], self.p[middle], 1)[0]) / self.reference
        there = float(np.mean(self.p[middle])) / self.reference
        return -slope / float(leak_share(there, self.ambient, share))  # type: ignore[no-untyped-call]


def _best(nodes: Sequence[_Node]) -> _Node:
    return min(nodes, key=lambda node: node.cost)


def _deviation(slopes: Array) -> float:
    """Return the standard deviation of the second parameter."""
    scale = np.linalg.norm(slopes, axis=0)
    scale[scale == 0.0] = 1.0
    own = slopes / scale
    return float(math.sqrt(np.linalg.pinv(own.T @ own)[1, 1]) / scale[1])


def settling_time(p: float, volume: float | None, temperature: float) -> float:
    """Return the time constant in s with which gas at rest comes to its wall's temperature, by natural convection.

    A cube with ``Nu = 0.13 Ra^(1/3)``, gas 5 K off the wall.

    Args:
        p: Pressure in Pa.
        volume: Volume in m^3; a litre where it is None.
        temperature: Temperature of the wall in K.

    References:
        W. H. McAdams, Heat Transmission, McGraw-Hill 1954.

    >>> round(settling_time(8e5, 1e-3, 293.15), 1)
    10.5
    """
    edge = (volume or 1e-3) ** (1.0 / 3.0)
    conductivity, viscosity, heat = 0.026, 1.8e-5, 1005.0
    density = p / (287.0 * temperature)
    film = 0.13 * conductivity * (9.81 * 5.0 / temperature * density**2 * heat / (viscosity * conductivity)) ** (1 / 3)
    return float(density * heat / 1.4 * edge / (6.0 * film))
