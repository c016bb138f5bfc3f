"""How sure an effect is: the probability that it is there beside the other named ones.

On clean data the squares alone are sure. On a real rig small unknown things act as well, some effect of the catalogue
resembles each of them, and the squares are sure of those too: what they do not know is which worlds there are. So the
probability is learned where the truth is known: a logistic law over what tells an effect from a stand-in, estimated on
exams whose rig shares no code with this program (``python -m benchmarks.confidence``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pneucli.diagnose.candidate import Reason
from pneucli.diagnose.data import FittedModel
from pneucli.diagnose.evidence import RESAMPLES, SEED
from pneucli.physics.sides import declared_name

MIN_NAMED_PROBABILITY = 0.5  # an effect that is less sure is not named: it is more likely absent


class Evidence(NamedTuple):
    """What tells an effect from a stand-in.

    ``share``: part of the squared error of ``compare`` beyond noise that it takes away, on held-out recordings where
    there are any; None where there is no such error. ``significance``: its size over its standard error. ``size``: that
    over the usual one. ``complete``: with it and the others nothing is left that is more than noise; where something
    is, a stand-in may have a share of it. ``left``: part of the squares beyond noise, of what it acts in, that is left
    with it in its place; of readings that show it alone, where there are such. ``imposed``: it acts in nothing but
    recordings whose motion is imposed and whose force is measured, where no error of the model piles up over time.
    ``effects``: the effect, and those that the data cannot tell from it.
    """

    share: float | None
    significance: float
    size: float
    complete: bool = False
    left: float = 1.0
    imposed: bool = False
    effects: tuple[str, ...] = ()

    @property
    def features(self) -> tuple[float, ...]:
        """The terms of the law: each within the range that exams have shown."""
        most = 1.0 if self.complete or self.imposed else MAX_RELATIVE_SIZE
        significance, size = _clipped_log10(self.significance, 1.0, 300.0), _clipped_log10(self.size, 0.03, most)
        if self.complete:
            share = 0.5 if self.share is None else min(max(self.share, 0.02), 0.98)
            return 1.0, significance, size, math.log(share / (1.0 - share))
        kept = 1.0 - (self.share or 0.0)
        return 1.0, significance, size, _clipped_log10(self.left, 0.01, 1.0), _clipped_log10(kept, 0.01, 1.0)


def _clipped_log10(value: float, low: float, high: float) -> float:
    return math.log10(min(max(value, low), high))


# times the usual size, the mean of typical ones, which reach about so far: beyond no effect is likelier. Small unknown
# things are not taken for one as large, unless the motion is imposed: what resembles grows against each other there
MAX_RELATIVE_SIZE = 2.0
# of each feature, in their order: benchmarks/confidence.py estimates them (docs/method.md)
WEIGHTS_WHITE_RESIDUAL = (-1.34, 2.52, 2.7, 0.32)  # where nothing but noise is left
WEIGHTS_DISCREPANCY = (-3.27, 2.06, 5.45, -1.47, -1.26)  # beside something unknown
# how much less than others an effect resembles what small unknown things do beside it, in the law's unit; where the
# motion is imposed all are alike, and so is an effect that no exam has hidden
EFFECT_INTERCEPTS = {
    "acceleration-bias": 0.7, "chamber-leak": 4.4, "constant-force": -3.1, "critical-ratio": 2.5, "dead-volume": 0.8,
    "dwell-breakaway": 3.3, "end-cushion": 3.5, "extra-mass": 0.4, "friction-asymmetry": -1.6,
    "friction-hysteresis": -3.8, "heat-transfer": 1.6, "laminar-leak": 3.2, "line-delay": -2.9, "opening-leak": 1.0,
    "position-friction": -0.5, "presliding": 1.3, "pressure-friction": -1.7, "pressure-lag": -0.6,
    "pressure-offset": -0.5, "pressure-scale": -3.7, "spring-force": 0.5, "stribeck": -2.5, "supply-droop": 1.4,
    "valve-deadband": 0.4, "valve-hysteresis": -3.6, "valve-lag": -4.2, "valve-leak": 3.8,
}  # fmt: skip
# the frequency with which an effect that was refused for this reason, and not weighed, was there on exams
PRESENCE_RATE_BY_REASON: dict[Reason, float] = {
    "raises-error": 0.06, "immaterial": 0.04, "at-bound": 0.03, "explained-by-unknown": 0.02, "needless": 0.02,
}  # fmt: skip
PRESENCE_RATE_OTHER = 0.003  # of all other reasons together


def probability(evidence: Evidence) -> float:
    """Return the probability that an effect with this evidence, or one that the data cannot tell from it, is there."""
    weights = WEIGHTS_WHITE_RESIDUAL if evidence.complete else WEIGHTS_DISCREPANCY
    exponent = sum(w * x for w, x in zip(weights, evidence.features, strict=True))
    if not (evidence.complete or evidence.imposed):
        exponent += mean_effect_intercept(evidence.effects)
    return 1.0 / (1.0 + math.exp(-exponent))


def mean_effect_intercept(effects: Sequence[str]) -> float:
    """Return how much less than others some effects resemble what small unknown things do, in the law's unit.

    What all of them explain as well resembles the unknown as each of them does: their mean. The least would be chance.
    """
    return sum(EFFECT_INTERCEPTS.get(declared_name(effect), 0.0) for effect in effects) / max(len(effects), 1)


def presence_rate(reason: Reason) -> float:
    """Return the probability that an effect is there which is not named for a reason."""
    return PRESENCE_RATE_BY_REASON.get(reason, PRESENCE_RATE_OTHER)


def likelihood_shares(states: Sequence[FittedModel]) -> list[float]:
    """Return the likelihood of each of some states over that of all, in the mean of their blocks drawn anew."""
    costs = np.array([state.costs for state in states])
    rng = np.random.default_rng(SEED)
    drawn = rng.multinomial(costs.shape[1], np.full(costs.shape[1], 1.0 / costs.shape[1]), RESAMPLES)
    sums = costs @ drawn.T
    likely = np.exp(-0.5 * (sums - sums.min(axis=0)))
    return [float(share) for share in np.mean(likely / likely.sum(axis=0), axis=1)]
