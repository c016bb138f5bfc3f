"""A steady bench: the source works on a throttle until nothing changes, and one row is written."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from pneucli.arrays import Array
from pneucli.exam.rig.gas import orifice_flow, pump_flow, regulated_opening
from pneucli.exam.rig.kernel import P1, PS, valve_area, valve_flow
from pneucli.exam.rig.parameters import Parameters

THROTTLE_RATIO = 0.4  # critical pressure ratio of the throttle


@dataclass(frozen=True)
class SteadyRows:
    """The rows of a steady bench: openings (V from the null) and areas of the throttle to ambient (m^2), each pair."""

    openings: Array
    throttles: Array


@dataclass(frozen=True)
class RowSensors:
    """Noise of a row, which is a mean of many readings: of pressures (Pa), of the flow relative to it."""

    pressure: float = 100.0
    flow: float = 0.004


def simulate_steady_rows(par: Parameters, rows: SteadyRows) -> dict[str, Array]:
    """Return the true signals of all rows, each of shape (n,), SI: u, p_supply (inlet), p1 (outlet), flow.

    The inlet of a pump is open to ambient.
    """
    opening, throttle = (part.ravel() for part in np.meshgrid(rows.openings, rows.throttles, indexing="ij"))
    p1 = np.array([_outlet(par, o, a) for o, a in zip(opening.tolist(), throttle.tolist(), strict=True)])
    flow = np.array([_throttled(par, a, p) for a, p in zip(throttle.tolist(), p1.tolist(), strict=True)])
    inlet = par.ambient if par.pump_flow > 0.0 else par.supply
    u = par.command_null + par.command_sign * opening
    return {"u": u, "p_supply": np.full(u.size, inlet), "p1": p1, "flow": flow}


def measure_rows(
    par: Parameters, sensors: RowSensors, truth: dict[str, Array], rng: np.random.Generator
) -> dict[str, Array]:
    """Return the written rows, SI, pressures above ambient."""
    n = truth["u"].size
    seen = {name: truth[name] - par.ambient + sensors.pressure * rng.standard_normal(n) for name in ("p_supply", "p1")}
    return {"u": truth["u"], **seen, "flow": truth["flow"] * (1.0 + sensors.flow * rng.standard_normal(n))}


def _outlet(par: Parameters, opening: float, throttle: float) -> float:
    """Return the pressure in Pa at which as much comes in as the throttle lets out."""

    def surplus(p: float) -> float:
        return _delivered(par, opening, p) - _throttled(par, throttle, p)

    highest = par.ambient + 1.0 / par.pump_clearance if par.pump_flow > 0.0 else par.supply
    return float(brentq(surplus, par.ambient, highest, xtol=1e-3))


def _delivered(par: Parameters, opening: float, p: float) -> float:
    """Return what the source delivers less what its own exhaust takes, in kg/s."""
    if par.pump_flow > 0.0:
        return float(pump_flow(par, opening, p))
    s = np.full(10, par.temperature)
    s[P1], s[PS] = p, par.supply
    q_in, q_out = valve_flow(par, valve_area(par, regulated_opening(par, opening, p), 0.0), 0.0, s)
    return float(q_in - q_out)


def _throttled(par: Parameters, throttle: float, p: float) -> float:
    return float(orifice_flow(throttle, p, par.temperature, par.ambient, THROTTLE_RATIO))
