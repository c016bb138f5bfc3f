"""The calibrated probability that an effect is present.

On clean data a likelihood ratio decides. On a real rig unmodelled effects act as well, some effect of the catalogue
resembles each of them, and the likelihood ratio is overconfident about it. The probability is therefore a logistic
model of the evidence, estimated on exams with known truth. Their rigs share no code with this program
(``python -m benchmarks.diagnosis calibration``). ``calibration.json`` has the weights, the exams and their seeds.
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
from pneucli.quantities import Z95

CALIBRATION: Mapping[str, Any] = json.loads(files("pneucli.diagnose").joinpath("calibration.json").read_bytes())
WEIGHTS_WHITE_RESIDUAL = tuple(CALIBRATION["weights"]["white_residual"].values())  # where only noise remains
WEIGHTS_DISCREPANCY = tuple(CALIBRATION["weights"]["discrepancy"].values())  # with an unmodelled effect present
# the frequency on exams with which an effect was present that was refused for a reason and has no evidence
PRESENCE_RATE_BY_REASON: Mapping[str, float] = CALIBRATION["presence_rate_by_reason"]
PRESENCE_RATE_OTHER: float = CALIBRATION["presence_rate_other"]  # of all other reasons together

MIN_NAMED_PROBABILITY = 0.5  # an effect with a lower probability is more probably absent and is not named
MIN_RELATIVE_SIZE = 0.1  # times the typical size: a smaller effect is no less probable with an unmodelled effect
MAX_RELATIVE_SIZE = 1.0  # the same: a larger effect is no more probable


class Evidence(NamedTuple):
    """The evidence for an effect against an unmodelled one that it resembles.

    ``share``: the part of the squared free-run error in excess of noise that the effect removes beside all others, on
    held-out recordings where there are any; None where there is no such error. ``significance``: its size over the
    standard error of its interval. ``size``: its size over the typical size. ``complete``: the model with all selected
    effects leaves only noise.
    ``left``: the variance of the residuals of the channel that the effect explains best, over that without it
    (:meth:`pneucli.diagnose.equivalence.Term.remaining_variance`).
    """

    share: float | None
    significance: float
    size: float
    complete: bool = False
    left: float = 1.0

    @property
    def features(self) -> tuple[float, ...]:
        """The terms of the logistic model, each clipped to the range of the exams."""
        if self.complete:
            share = 0.5 if self.share is None else min(max(self.share, 0.02), 0.98)
            size = _clipped_log10(self.size, 0.03, MAX_RELATIVE_SIZE)
            return 1.0, _clipped_log10(self.significance, 1.0, 300.0), size, math.log(share / (1.0 - share))
        return (
            1.0,
            _clipped_log10(self.size, MIN_RELATIVE_SIZE, MAX_RELATIVE_SIZE),
            _clipped_log10(self.left, 0.01, 1.0),
        )


def _clipped_log10(value: float, low: float, high: float) -> float:
    return math.log10(min(max(value, low), high))


def probability(evidence: Evidence) -> float:
    """Return the probability that an effect with this evidence, or one of its equivalents, is present.

    With an unmodelled effect present, the significance decides only whether the interval contains the null: beyond
    that it did not improve the probability in worlds left out, nor did the free-run error.
    """
    if not evidence.complete and evidence.significance < Z95:
        return presence_rate("interval-contains-null")
    weights = WEIGHTS_WHITE_RESIDUAL if evidence.complete else WEIGHTS_DISCREPANCY
    logit = sum(w * x for w, x in zip(weights, evidence.features, strict=True))
    return 1.0 / (1.0 + math.exp(-logit))


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
