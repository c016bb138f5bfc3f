"""What a recording says of a part of the rig: residuals of one subsystem at a time, the rest fed with measurements.

``Chambers``: the pressures are simulated with the measured motion, so friction has no say. ``Forces``: the measured
motion and pressures leave a friction force, which is held against the model's set of possible ones, so the gas has no
say. ``Inferred``: the same where p2 was not recorded, with that of the model. ``Imposed``: the force that the model
needs for the given motion against the measured one. ``Whole``: all channels simulated, where a subsystem lacks a
signal. Each view is smooth in its parameters, which a free run with stick and slip is not. One module each; a new
subsystem is one more, and a line in :func:`views_of`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pneucli.identify.residuals.base import View
from pneucli.identify.residuals.chambers import Chambers
from pneucli.identify.residuals.force_balance import Forces, Inferred
from pneucli.identify.residuals.free_run import Imposed, Whole
from pneucli.simulate.experiment import Experiment

__all__ = ["Chambers", "Forces", "Imposed", "Inferred", "View", "Whole", "views_of", "weighted"]


def views_of(experiments: Sequence[Experiment], *, whitened: bool = False) -> list[View]:
    """Return the views that the recorded signals allow; ``whitened`` chambers are so for the errors of their starts."""
    return [view for e in experiments for view in _of(e, whitened=whitened) if view.channels]


def _of(e: Experiment, *, whitened: bool) -> list[View]:
    if e.recording.imposed == "motion":
        return [Imposed(e)]
    if e.recording.kind.vessel:
        return [Chambers(e, whitened)]
    if "x" not in e.raw:
        return [Whole(e)]
    if not e.recording.kind.valve:
        return [Forces(e)]
    return [Inferred(e) if e.infers_p2 else Forces(e), Chambers(e.imposing(), whitened)]


def weighted(views: Sequence[View], weights: Mapping[Any, float]) -> list[View]:
    """Return the views with weights by channel, by which a fit multiplies their residuals; 1 where none is given."""
    return [replace(view, weights=weights) for view in views] if weights else list(views)
