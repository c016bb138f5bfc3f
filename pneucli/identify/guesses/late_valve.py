"""How late the flow into the chambers follows the command, straight from it: where a fit of a lag or a delay starts.

A model without it opens its valve at the wrong time, and the areas that are fitted to it leave nothing of the valve: no
derivative leads back from there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.identify.guesses.chamber_balance import PRESSURE_SIGNALS, Chamber
from pneucli.identify.guesses.flow_paths import FlowPathData, flow_path_data, mass_flux
from pneucli.identify.guesses.valve_areas import guess_map
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.valve_forms.area import ValveArea

TIMES = 24  # of the search, in equal ratios: a fit goes on from the nearest
BINS = 40  # of the opening, at equal quantiles, each with an area of its own
MAX_SAMPLES = 20_000  # of all recordings: more do not move a start
MIN_KNOTS = 3  # of each direction, fewer tell no overlap


class LateValve(NamedTuple):
    """The time in s by which a valve is late, and its areas with that time."""

    time: float
    valves: tuple[ValveArea, ...]


def after_a_lag(opening: Array, period: float, time: float) -> Array:
    """Return the opening (n,), sampled every ``period`` s, behind a first-order lag of ``time`` s.

    >>> after_a_lag(np.array([0.0, 1.0, 1.0]), 1.0, 1.0).round(3).tolist()
    [0.0, 0.632, 0.865]
    """
    return lagged(np.ascontiguousarray(opening, dtype=np.float64), math.exp(-period / time))


@compiled()
def lagged(opening: Array, remains: float) -> Array:
    """Return the opening (n,) behind a lag of which the share ``remains`` is left after a sample."""
    out = np.empty(opening.size)
    reached = opening[0]
    for k in range(opening.size):
        reached = opening[k] + remains * (reached - opening[k])
        out[k] = reached
    return out


def after_a_delay(opening: Array, period: float, time: float) -> Array:
    """Return the opening (n,), sampled every ``period`` s, ``time`` s late, to the nearest sample.

    >>> after_a_delay(np.array([0.0, 1.0, 2.0]), 1.0, 1.0).tolist()
    [0.0, 0.0, 1.0]
    """
    late = min(round(time / period), opening.size)
    return np.concatenate([np.full(late, opening[0]), opening[: opening.size - late]])


LATENESS: dict[str, Callable[[Array, float, float], Array]] = {"lag": after_a_lag, "delay": after_a_delay}


def late_valve(
    experiments: Sequence[Experiment], rig: Rig, vessel_volume: float, how: str, longest: float
) -> LateValve | None:
    """Find the time by which a valve is late: with it, areas over the opening explain the flow best.

    Args:
        experiments: The experiments.
        rig: The rig with its volumes and areas.
        vessel_volume: Volume of the vessel in m^3, for a valve test.
        how: Key of ``LATENESS``.
        longest: The longest time in s that is tried.

    Returns:
        The time, with a valve a chamber whose flow was recorded; None where no time explains more than none.
    """
    chambers: tuple[Chamber, ...] = (1, 2)
    found = {c: own for c in chambers if (own := list(flow_path_data(experiments, rig, c, vessel_volume)))}
    every = -(-sum(one.flow.size for own in found.values() for one in own) // MAX_SAMPLES)
    paths = {c: [_Path.of(one, rig, c, every) for one in own] for c, own in found.items()}
    shortest = min((one.period for own in paths.values() for one in own), default=longest)
    if longest <= shortest:
        return None

    def late(time: float) -> dict[Chamber, list[FlowPathData]]:
        return {c: [one.late(how, time) for one in own] for c, own in paths.items()}

    def unexplained(time: float) -> float:
        return sum(map(_unexplained_power, late(time).values()))

    times = np.geomspace(shortest, longest, TIMES)
    powers = [unexplained(time) for time in times]
    best = int(np.argmin(powers))
    if not powers[best] < unexplained(0.0):
        return None
    valves = [guess_map(own, "valve" if c == 1 else "valve_2") for c, own in late(times[best]).items()]
    is_known = all(min(np.sum(np.array(v.commands) * sign > 0.0) for sign in (1.0, -1.0)) >= MIN_KNOTS for v in valves)
    return LateValve(float(times[best]), tuple(valves)) if is_known else None


class _Path(NamedTuple):
    """One recording of a chamber's paths: the whole opening (n,) in V, and every so manyth sample of the rest, (k,).

    ``filling`` and ``venting`` are the mass flux in kg/(s m^2) of an opening of that sign.
    """

    data: FlowPathData
    every: int
    filling: Array
    venting: Array

    @classmethod
    def of(cls, data: FlowPathData, rig: Rig, chamber: Chamber, every: int) -> _Path:
        inputs = data.experiment.inputs[::every]
        supply, p = inputs[:, at.IN_SUPPLY], inputs[:, PRESSURE_SIGNALS[1 if data.experiment.vessel else chamber][1]]
        signs = np.ones(p.size), -np.ones(p.size)
        return cls(data, every, *(mass_flux(rig, sign, supply, p) for sign in signs))

    @property
    def period(self) -> float:
        return self.data.experiment.recording.period

    def late(self, how: str, time: float) -> FlowPathData:
        """Return the paths where the opening is late."""
        opening = self.data.opening
        opening = (LATENESS[how](opening, self.period, time) if time else opening)[:: self.every]
        flux = np.where(opening > 0.0, self.filling, self.venting)
        return replace(self.data, opening=opening, flow=self.data.flow[:: self.every], mass_flux=flux)


def _unexplained_power(paths: Sequence[FlowPathData]) -> float:
    """Return the sum of squares of the flow that an area for each bin of the opening and its sign leaves, kg^2/s^2."""
    opening, flow, flux = (
        np.concatenate([getattr(one, name) for one in paths]) for name in ("opening", "flow", "mass_flux")
    )
    edges = np.quantile(opening, np.linspace(0.0, 1.0, BINS + 1)[1:-1])
    places = 2 * np.searchsorted(edges, opening) + (opening > 0.0)
    products, powers = (np.bincount(places, flux * other, 2 * BINS) for other in (flow, flux))
    explained = np.divide(products**2, powers, out=np.zeros(2 * BINS), where=powers > 0.0)
    return float(flow @ flow - explained.sum())
