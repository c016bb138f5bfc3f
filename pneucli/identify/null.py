"""The command at which nothing flows, from what fills a chamber and what vents it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.identify.paths import paths
from pneucli.recording import Recording, Rig
from pneucli.simulate.experiment import prepare

Array = NDArray[np.float64]

COMMANDS = 2000
SLIGHT = 0.002  # of all gas that moved: less on the wrong side is noise, or gas on its way
ANY_VOLUME = 1.0  # m^3, of a vessel: each recording's flow is scaled


def with_null(recordings: Sequence[Recording], rig: Rig) -> Rig:
    """Return the rig with its null command (V) and the range in which that lies, where the file asks to identify it.

    At commands above, chamber 1 (or the vessel) is filled, below it is vented: the null is where the gas that moves the
    other way is least, in the middle of what makes no difference (an overlap, or commands that were never given).
    Raises InputError where no recording shows both filling and venting.
    """
    if not rig.null_free:
        return rig
    driven = [r for r in recordings if r.kind.valve and not r.valve_shut]
    if not driven:
        return rig
    u, flow = _flows(driven, replace(rig, valve_null=0.0))
    order = np.argsort(u, kind="stable")
    u, flow = u[order], flow[order]
    grown, shrunk = np.maximum(flow, 0.0), np.maximum(-flow, 0.0)
    if not u.size or u[0] == u[-1] or not grown.any() or not shrunk.any():
        found = '"identify", but chamber 1 is never both filled and vented by commands that were recorded'
        raise InputError("[rig.valve] null", found, "both", "state the command at which nothing flows")
    tried = np.linspace(u[0], u[-1], COMMANDS)
    below = np.searchsorted(u, tried)
    wrong = np.append(0.0, np.cumsum(grown))[below] + np.sum(shrunk) - np.append(0.0, np.cumsum(shrunk))[below]
    best = tried[wrong <= wrong.min() + SLIGHT * float(np.sum(grown) + np.sum(shrunk))]
    low, high = float(best[0]), float(best[-1])
    return replace(rig, valve_null=0.5 * (low + high), null_range=(low, high))


def _flows(recordings: Sequence[Recording], rig: Rig) -> tuple[Array, Array]:
    """Return commands in V and what flows into chamber 1, as large as it may be, at all samples."""
    ready = [prepare(r, rig, None) for r in recordings if {"u", "p1"} <= r.signals.keys()]
    shown = list(paths(ready, rig, 1, ANY_VOLUME))
    if not shown:
        return np.zeros(0), np.zeros(0)
    scaled = [one.flow / max(float(np.max(np.abs(one.flow))), 1e-300) for one in shown]  # each recording counts alike
    return np.concatenate([one.opening for one in shown]), np.concatenate(scaled)
