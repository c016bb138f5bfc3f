"""How sure an effect is: the probability that it is there beside the other named ones.

On clean data the likelihood alone is sure. On a real rig small unknown things act as well, some effect of the catalogue
resembles each of them, and the likelihood is sure of those too: what it does not know is which worlds there are. So the
probability is learned where the truth is known: a logistic law over what tells an effect from a stand-in, estimated on
exams whose rig shares no code with this program (``python -m benchmarks.confidence``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pneucli.diagnose.decision import Reason
from pneucli.diagnose.evidence import RESAMPLES, SEED
from pneucli.diagnose.trial import State

NAMED = 0.5  # an effect that is less sure is not named: it is more likely absent


class Evidence(NamedTuple):
    """What tells an effect from a stand-in.

    ``share``: part of the squares beyond noise that it explains on all readings. ``disagreement``: by which part of its
    size single recordings want it changed. ``unknown``: what a smooth function of one signal would explain instead,
    over what it explains. ``gain``: the fall of the deviance for each reading. ``clear``: whether nothing is left
    beside all that was found.
    """

    share: float
    disagreement: float
    unknown: float
    gain: float
    clear: bool

    @property
    def features(self) -> tuple[float, ...]:
        """The terms of the law: each within the range that the exams have shown."""
        share = min(max(self.share, 0.02), 0.98)
        return (
            1.0,
            math.log10(min(max(self.disagreement, 0.01), 1.0)),
            min(max(self.unknown, 0.0), 1.2),
            math.log(share / (1.0 - share)),
            math.log10(min(max(self.gain, 0.002), 1.0)),
            float(self.clear),
        )


# of each feature, in their order: benchmarks/confidence.py estimates them. These were found the same way on 148 cases
# which an earlier search had answered (docs/diagnosis.md); with the search as it is they were not estimated anew
WEIGHTS = (-0.69, -1.45, -0.42, 0.35, 1.28, 1.21)
# the frequency with which an effect that was not named for this reason was there, on the same exams
REFUSED: dict[Reason, float] = {"explained-by-unknown": 0.1, "immaterial": 0.1, "needless": 0.03}
OTHERWISE = 0.002  # of all other reasons together


def probability(evidence: Evidence) -> float:
    """Return the probability that an effect with this evidence is there."""
    exponent = sum(w * x for w, x in zip(WEIGHTS, evidence.features, strict=True))
    return 1.0 / (1.0 + math.exp(-exponent))


def refused(reason: Reason) -> float:
    """Return the probability that an effect is there which is not named for a reason."""
    return REFUSED.get(reason, OTHERWISE)


def shares(states: Sequence[State]) -> list[float]:
    """Return the likelihood of each of some states over that of all, in the mean of their blocks drawn anew."""
    costs = np.array([state.costs for state in states])
    rng = np.random.default_rng(SEED)
    drawn = rng.multinomial(costs.shape[1], np.full(costs.shape[1], 1.0 / costs.shape[1]), RESAMPLES)
    sums = costs @ drawn.T
    likely = np.exp(-0.5 * (sums - sums.min(axis=0)))
    return [float(share) for share in np.mean(likely / likely.sum(axis=0), axis=1)]
