"""How large an effect is as fitted: over its standard error, and over what a rig plausibly shows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from pneucli.identify.fit import Estimate, Fit
from pneucli.identify.parameters import null_value
from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.scales import Facts

TINY = 1e-300


class Magnitude(NamedTuple):
    """The distance from where the effect is absent, over its standard error and over that of usual values.

    Usual is the geometric mean of the typical values' distances: sizes of rigs differ by factors. Of several parameters
    the one that is farthest counts. Of an effect that no value makes absent the first parameter stands over its own
    error, and its size is 1: nothing is said of it.
    """

    over_error: float
    over_usual: float


def magnitude(found: Fit, effect: Effect, facts: Facts) -> Magnitude:
    """Return the magnitude of an effect of a fitted model, on the rig of these facts."""
    known = {e.name: e for e in found.estimates}
    mine = [(p, known[name]) for p in effect.parameters if (name := f"{effect.name}.{p.name}") in known]
    placed = [_placed(found, p, e, facts) for p, e in mine if p.null is not None]
    if placed:
        return Magnitude(max(m.over_error for m in placed), max(m.over_usual for m in placed))
    return Magnitude(abs(mine[0][1].value) / max(mine[0][1].error, TINY), 1.0) if mine else Magnitude(0.0, 1.0)


def _placed(found: Fit, parameter: Parameter, estimate: Estimate, facts: Facts) -> Magnitude:
    """Return the magnitude by one parameter; where its null is infinite the reciprocal is what grows from nothing."""
    null, typical = null_value(parameter, found.model), parameter.on(facts).typical
    error, value = max(estimate.error, TINY), estimate.value
    if null is None:
        return Magnitude(abs(value) / error, _middle(typical) / max(abs(value), TINY) if typical else 1.0)
    distances = [abs(one - null) for one in typical if one != null]
    return Magnitude(abs(value - null) / error, abs(value - null) / _middle(distances) if distances else 1.0)


def _middle(values: Sequence[float]) -> float:
    return math.exp(math.fsum(map(math.log, values)) / len(values))
