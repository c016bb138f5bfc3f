"""How large an effect is as fitted, over what a rig plausibly shows."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pneucli.diagnose.evidence import TINY
from pneucli.identify.fit import Fit
from pneucli.identify.parameters import null_value, value_of
from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.scales import Facts


def magnitude(found: Fit, effect: Effect, facts: Facts) -> float:
    """Return the distance of an effect from where it is absent over that of usual values, on the rig of these facts.

    Usual is the geometric mean of the typical values' distances: sizes of rigs differ by factors. Of several parameters
    the one that is farthest counts. Of an effect that no value makes absent nothing is said: 1.
    """
    fitted = {e.name for e in found.estimates}
    mine = [p for p in effect.parameters if p.null is not None and f"{effect.name}.{p.name}" in fitted]
    return max((_over_usual(found, effect, p, facts) for p in mine), default=1.0)


def _over_usual(found: Fit, effect: Effect, parameter: Parameter, facts: Facts) -> float:
    """Return the same by one parameter; where its null is infinite the reciprocal is what grows from nothing."""
    null, typical = null_value(parameter, found.model), parameter.on(facts).typical
    value = value_of(found.model, f"{effect.name}.{parameter.name}")
    if null is None:
        return _middle(typical) / max(abs(value), TINY) if typical else 1.0
    distances = [abs(one - null) for one in typical if one != null]
    return abs(value - null) / _middle(distances) if distances else 1.0


def _middle(values: Sequence[float]) -> float:
    return math.exp(math.fsum(map(math.log, values)) / len(values))
