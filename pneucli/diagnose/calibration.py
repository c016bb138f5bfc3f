"""The calibrated probability that an effect is present.

On clean data a likelihood ratio decides. On a real rig unmodelled effects act as well, some effect of the catalogue
resembles each of them, and the likelihood ratio is overconfident about it. The probability is therefore a logistic
model of the evidence, estimated on exams with known truth. Their rigs share no code with this program
(``python -m benchmarks.calibration``). ``calibration.json`` has the weights, the exams and their seeds.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from pneucli.diagnose.candidate import Reason
from pneucli.diagnose.evidence import RESAMPLES, SEED
from pneucli.diagnose.score import FittedModel
from pneucli.physics.sides import declared_name

CALIBRATION: Mapping[str, Any] = json.loads(files("pneucli.diagnose").joinpath("calibration.json").read_bytes())
WEIGHTS_WHITE_RESIDUAL = tuple(CALIBRATION["weights"]["white_residual"].values())  # where only noise remains
WEIGHTS_DISCREPANCY = tuple(CALIBRATION["weights"]["discrepancy"].values())  # with an unmodelled effect present
# how much less often than average an unmodelled effect resembles this one, in logits. It applies with an unmodelled
# effect present and without imposed motion. An effect that no exam has hidden has 0
EFFECT_INTERCEPTS: Mapping[str, float] = CALIBRATION["effect_intercepts"]
# the frequency on exams with which an effect was present that was refused for a reason and has no evidence
PRESENCE_RATE_BY_REASON: Mapping[str, float] = CALIBRATION["presence_rate_by_reason"]
PRESENCE_RATE_OTHER: float = CALIBRATION["presence_rate_other"]  # of all other reasons together

MIN_NAMED_PROBABILITY = 0.5  # an effect with a lower probability is more probably absent and is not named
# times the typical size, the geometric mean of the declared typical values, which reach about this far. An unmodelled
# effect seldom looks so large, except with imposed motion, where similar effects grow against each other
MAX_RELATIVE_SIZE = 2.0


class Evidence(NamedTuple):
    """The evidence for an effect against an unmodelled one that it resembles.

    ``share``: the part of the squared free-run error in excess of noise that the effect removes, on held-out recordings
    where there are any; None where there is no such error. ``significance``: its size over its standard error.
    ``size``: its size over the typical size. ``complete``: the model with all selected effects leaves only noise.
    ``left``: the part of the cost in excess of noise, in the residuals that the effect influences, that remains with
    it; of its exclusive channels, where it has such. ``imposed``: the effect acts only in recordings with imposed
    motion and measured force, where no model error accumulates over time. ``effects``: the effect, and its equivalents.
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
        """The terms of the logistic model, each clipped to the range of the exams."""
        max_size = 1.0 if self.complete or self.imposed else MAX_RELATIVE_SIZE
        significance, size = _clipped_log10(self.significance, 1.0, 300.0), _clipped_log10(self.size, 0.03, max_size)
        if self.complete:
            share = 0.5 if self.share is None else min(max(self.share, 0.02), 0.98)
            return 1.0, significance, size, math.log(share / (1.0 - share))
        remaining = 1.0 - (self.share or 0.0)
        return 1.0, significance, size, _clipped_log10(self.left, 0.01, 1.0), _clipped_log10(remaining, 0.01, 1.0)


def _clipped_log10(value: float, low: float, high: float) -> float:
    return math.log10(min(max(value, low), high))


def probability(evidence: Evidence) -> float:
    """Return the probability that an effect with this evidence, or one of its equivalents, is present."""
    weights = WEIGHTS_WHITE_RESIDUAL if evidence.complete else WEIGHTS_DISCREPANCY
    logit = sum(w * x for w, x in zip(weights, evidence.features, strict=True))
    if not (evidence.complete or evidence.imposed):
        logit += mean_effect_intercept(evidence.effects)
    return 1.0 / (1.0 + math.exp(-logit))


def mean_effect_intercept(effects: Sequence[str]) -> float:
    """Return the mean intercept of equivalent effects in logits.

    The same unmodelled effect resembles each of them. The lowest intercept would be that of one effect by chance.
    """
    return sum(EFFECT_INTERCEPTS.get(declared_name(effect), 0.0) for effect in effects) / max(len(effects), 1)


def presence_rate(reason: Reason) -> float:
    """Return the probability that an effect is present that was refused for a reason and has no evidence."""
    return PRESENCE_RATE_BY_REASON.get(reason, PRESENCE_RATE_OTHER)


def likelihood_shares(fitted: Sequence[FittedModel]) -> list[float]:
    """Return the likelihood of each model over that of all, as a mean over block-bootstrap resamples."""
    costs = np.array([one.costs for one in fitted])
    rng = np.random.default_rng(SEED)
    counts = rng.multinomial(costs.shape[1], np.full(costs.shape[1], 1.0 / costs.shape[1]), RESAMPLES)
    sums = costs @ counts.T
    likelihood = np.exp(-0.5 * (sums - sums.min(axis=0)))
    return [float(share) for share in np.mean(likelihood / likelihood.sum(axis=0), axis=1)]
