"""What changed between two sets of recordings of one rig: which parameter or effect, by how much, how sure.

Both were fitted with the same model (:mod:`pneucli.changes.baseline`). Were nothing else, the estimates would differ
by their errors alone. Each hypothesis says that one thing differs: a parameter of the model, all areas of a valve
alike, or an effect that the model lacks, which has come, gone or grown. It is judged under the constraint that all else
is as it was, which makes a small change visible; what the model lacks in both stands in both and does not count.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from pneucli.changes.baseline import Baseline
from pneucli.changes.repeatability import NO_DRIFT, RESIDUAL_LEVEL, Repeatability
from pneucli.diagnose.evidence import effective_degrees_of_freedom
from pneucli.identify.estimation.least_squares import pseudo_inverse

Array = NDArray[np.float64]

ALARM_RATE = 1e-3  # false alarms for each rig and comparison
UNEXPLAINED = "unexplained"  # the name of what changed where nothing of the model or the catalogue accounts for it
MIN_ONE_SIDED_SHARE = 0.5  # of a change, at least, by the side on which a one-sided effect is larger
MIN_LEVERAGE_COMPLEMENT = 1e-12  # of what a block alone says of an effect, that others say as well
LOG_NOISE_POWER_ERROR = (
    0.1  # the standard error of the logarithm of the noise's power, as two recordings' noise is estimated
)
_AREA = re.compile(r"(valve(?:_2)?\.effective_area)\(.+\)")


@dataclass(frozen=True)
class Hypothesis:
    """One thing that may have changed, by ``name``: coordinates (k,) that move together, or an effect's start."""

    name: str
    direction: Array | None = None
    effect_index: int | None = None


@dataclass(frozen=True)
class HypothesisTest:
    """One hypothesis and what the data say: the ``size`` of the change along its direction, and the ``error`` of that.

    ``degrees_of_freedom``: how many blocks of data that error rests on.
    """

    hypothesis: Hypothesis
    size: float
    error: float
    degrees_of_freedom: float

    @property
    def t_statistic(self) -> float:
        """The size over its error."""
        return self.size / self.error if self.error > 0.0 else 0.0

    @property
    def p_value(self) -> float:
        """The chance of a size like this or a larger one where nothing changed."""
        return float(2.0 * student.sf(abs(self.t_statistic), self.degrees_of_freedom))

    def minimum_detectable_size(self, p_value: float) -> float:
        """The size from which the chance would be below ``p_value``."""
        return float(student.isf(0.5 * p_value, self.degrees_of_freedom)) * self.error


@dataclass(frozen=True)
class Comparison:
    """Two references of one model, the old one first; ``accepted``: what is known to have changed, and is let free.

    ``repeatability`` is what a healthy rig varies by from date to date, of the quantities by their ``names``: coordinates, then
    starts.
    """

    old: Baseline
    new: Baseline
    accepted: tuple[Hypothesis, ...] = ()
    repeatability: Repeatability = NO_DRIFT
    names: tuple[str, ...] = ()

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """All that may have changed; a parameter that stands at a bound on one side tells nothing."""
        return (*self._single(), *self._areas(), *self._effects())

    def _single(self) -> Iterator[Hypothesis]:
        for j, (a, b) in enumerate(zip(self.old.coordinates, self.new.coordinates, strict=True)):
            if not a.at_bound and not b.at_bound:
                yield Hypothesis(a.name, np.eye(len(self.old.coordinates))[j])

    def _areas(self) -> Iterator[Hypothesis]:
        named = [_AREA.fullmatch(c.name) for c in self.old.coordinates]
        for name in dict.fromkeys(m[1] for m in named if m):
            mine = np.array([float(m is not None and m[1] == name) for m in named])
            if mine.sum() > 1.0:
                yield Hypothesis(name, mine)

    def _effects(self) -> Iterator[Hypothesis]:
        for i, start in enumerate(self.old.typical_effects):
            if min(self.old.power[i], self.new.power[i]) > 0.0:
                yield Hypothesis(start.effect, effect_index=i)

    def test_all(self) -> list[HypothesisTest]:
        """Return every hypothesis that is not taken, the least probable by chance first."""
        taken = {(h.name, h.effect_index) for h in self.accepted}
        found = [self.test(h) for h in self.hypotheses if (h.name, h.effect_index) not in taken]
        return sorted((f for f in found if f is not None), key=lambda f: (f.p_value, -abs(f.t_statistic)))

    def test(self, hypothesis: Hypothesis) -> HypothesisTest | None:
        """Return what the data say of one hypothesis; None where they say nothing.

        The differences of the estimates (k,), with those of the effects' steps, are weighed by what they would vary by
        were the residuals white; what they do vary by is told by the blocks.
        """
        starts = [h.effect_index for h in (*self.accepted, hypothesis) if h.effect_index is not None]
        if len(starts) > 1:
            return None  # an effect that is known to have changed is in the model (Reference.beside)
        varies, known = self.repeat_variance(starts)
        weight = pseudo_inverse(
            _white_noise_covariance(self.old, starts) + _white_noise_covariance(self.new, starts) + np.diag(varies)
        )
        columns = np.array([_direction(h, starts, self.old) for h in (hypothesis, *self.accepted)]).T
        bread = pseudo_inverse(columns.T @ weight @ columns)
        contrast = (bread @ columns.T @ weight)[0]
        difference = _estimates(self.new, starts) - _estimates(self.old, starts)
        parts = np.concatenate([_block_contributions(one, starts, contrast) for one in (self.old, self.new)])
        drifting = contrast**2 * varies
        error = float(np.sqrt(np.sum(parts**2) + np.sum(drifting)))
        size = float(contrast @ difference)
        if not np.isfinite(error) or error <= 0.0:
            return None
        if hypothesis.effect_index is not None and not self._is_admissible(hypothesis.effect_index, size):
            size = 0.0
        own = known[columns[:, 0] != 0.0].min()
        return HypothesisTest(hypothesis, size, error, min(_satterthwaite_freedom(parts, drifting, known), own))

    def repeat_variance(self, starts: Sequence[int] = ()) -> tuple[Array, Array]:
        """Return the variance that a healthy difference of two dates has beyond its error, for all coordinates and the
        steps of ``starts`` (k + len(starts),), and its degrees of freedom.
        """
        k = len(self.old.coordinates)
        named = (
            [self.names[i] for i in (*range(k), *(k + i for i in starts))] if self.names else [""] * (k + len(starts))
        )
        variance, freedom = self.repeatability.variance_and_freedom(named)
        return 2.0 * variance, freedom

    def _is_admissible(self, start: int, size: float) -> bool:
        """Whether the effect is there on the side on which it would be larger: a leak does not fall below none."""
        side = self.new if size > 0.0 else self.old
        return not side.typical_effects[start].one_sided or float(side.steps[start]) > MIN_ONE_SIDED_SHARE * abs(size)

    def residual_level_test(self) -> HypothesisTest:
        """Return how the logarithm of the mean square residual differs, block by block where both have as many."""
        old, new = self.old.levels, self.new.levels
        if old.size == new.size:
            difference = (new - old)[np.isfinite(new - old)]
            mean, error = float(difference.mean()), float(difference.std(ddof=1)) / np.sqrt(difference.size)
        else:
            old, new = old[np.isfinite(old)], new[np.isfinite(new)]
            mean = float(new.mean() - old.mean())
            error = float(np.hypot(new.std(ddof=1) / np.sqrt(new.size), old.std(ddof=1) / np.sqrt(old.size)))
        blocks = float(min(np.isfinite(self.old.levels).sum(), np.isfinite(self.new.levels).sum()))
        (varies,), (known,) = self.repeatability.variance_and_freedom([RESIDUAL_LEVEL])
        error = float(np.sqrt(error**2 + LOG_NOISE_POWER_ERROR**2 + 2.0 * varies))
        return HypothesisTest(Hypothesis(UNEXPLAINED), mean, error, min(max(blocks - 1.0, 1.0), known))

    def with_accepted(self, *hypotheses: Hypothesis) -> Comparison:
        """Return the comparison in which further things are known to have changed."""
        return replace(self, accepted=(*self.accepted, *hypotheses))


def _satterthwaite_freedom(parts: Array, drifting: Array, known: Array) -> float:
    """Return the degrees of freedom of a variance that blocks (B,) and drifts (n,) add up to (F. E. Satterthwaite)."""
    blocks = float(np.sum(parts**2))
    spread = blocks**2 / effective_degrees_of_freedom(parts) + float(np.sum(drifting**2 / known))
    return (blocks + float(np.sum(drifting))) ** 2 / spread


def _direction(hypothesis: Hypothesis, starts: Sequence[int], reference: Baseline) -> Array:
    """Return how a hypothesis moves the coordinates and the steps of ``starts``, shape (k + len(starts),)."""
    k = len(reference.coordinates)
    direction = np.zeros(k + len(starts))
    if hypothesis.direction is not None:
        direction[:k] = hypothesis.direction
    else:
        direction[k + starts.index(hypothesis.effect_index)] = 1.0
    return direction


def _estimates(one: Baseline, starts: Sequence[int]) -> Array:
    """Return the estimates with the effects of ``starts`` in the model, then their steps."""
    places = one.estimates.copy()
    for i in starts:
        places -= one.bias[:, i] * one.steps[i]
    return np.append(places, one.steps[list(starts)])


def _white_noise_covariance(one: Baseline, starts: Sequence[int]) -> Array:
    """Return the covariance of :func:`_estimates` were the residuals white."""
    k = len(one.coordinates)
    out = np.zeros((k + len(starts), k + len(starts)))
    out[:k, :k] = one.white_noise_covariance
    for n, i in enumerate(starts):
        bias, variance = one.bias[:, i], 1.0 / one.power[i]
        out[:k, :k] += variance * np.outer(bias, bias)
        out[:k, k + n] = out[k + n, :k] = -variance * bias
        out[k + n, k + n] = variance
    return out


def _block_contributions(one: Baseline, starts: Sequence[int], contrast: Array) -> Array:
    """Return what each block adds to a contrast of :func:`_estimates` (B,).

    Where a step is taken, each block is held against the step that the others want (the jackknife, or HC3): one that
    alone shows an effect fits it perfectly, and would else vouch for it without any doubt.
    """
    influence, columns = one.influence.copy(), []
    for i in starts:
        step = one.step_influence[:, i]
        if (
            one.step_cross_influence is not None and one.block_power_share is not None
        ):  # a change that is there is no scatter
            influence += one.steps[i] * one.step_cross_influence[i]
            step = (step - one.steps[i] * one.block_power_share[:, i]) / np.maximum(
                1.0 - one.block_power_share[:, i], MIN_LEVERAGE_COMPLEMENT
            )
        influence -= np.outer(step, one.bias[:, i])
        columns.append(step)
    parts = np.column_stack([influence, *columns]) @ contrast
    blocks, fitted = parts.size, len(one.coordinates) + len(starts)
    return np.asarray(parts * np.sqrt(blocks / max(blocks - fitted, 1)))
