"""The tests that a trial must pass to be supported, and the reason where it does not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from pneucli.diagnose.adequacy import significant_lack_of_fit
from pneucli.diagnose.candidate import Decision, Reason, supported_candidates
from pneucli.diagnose.data import Candidate, DiagnosisData, FittedModel, lack_of_fit
from pneucli.diagnose.evidence import holm_adjusted
from pneucli.diagnose.validity import refuted_by_reading
from pneucli.identify.estimation.parameters import absent_value

ALPHA = 0.02  # of naming any effect where none is, before it is held out
ALPHA_RARELY_SHOWN = 1e-4  # the same for what shows so rarely that the data held out cannot be certain
MIN_EFFECTIVE_BLOCKS = 5.0  # blocks in which it shows there
MIN_COST_SHARE = 0.004  # of the cost: less does not change what the user sees
MIN_COST_SHARE_AT_NOISE = 0.02  # the same where noise is left: the laws of the base, smoothing and clock err by as much
MIN_RESOLVED_PERIODS = 0.5  # of a sampling period: a time shorter than this may be the clock's, or the model's own step
NOISE_COST_RATIO = 1.05  # times as much as sensors' noise alone would leave


def apply_tests(bench: DiagnosisData, before: FittedModel, trials: Sequence[Candidate]) -> list[Decision]:
    """Decide on each trial: significant in the family of all, material, and held by data not seen?"""
    adjusted = holm_adjusted([t.p_value for t in trials], max(bench.hypothesis_count, len(trials)))
    return [Decision(t.effect, _reason(bench, before, t, p), t) for t, p in zip(trials, adjusted, strict=True)]


def passing_candidates(bench: DiagnosisData, before: FittedModel, trials: Sequence[Candidate]) -> list[Candidate]:
    """Return the trials that pass all tests."""
    return supported_candidates(apply_tests(bench, before, trials))


def _reason(bench: DiagnosisData, before: FittedModel, trial: Candidate, p_value: float) -> Reason:
    """Return why a trial passes or not; where it ended comes before chance, which a bound distorts."""
    ends = _end_locations(trial)
    unlikely, certain = p_value < ALPHA, trial.test_gain.significant or not bench.has_held_out_data
    failed: list[tuple[bool, Reason]] = [
        (bool(ends) and set(ends) == {"null"}, "vanishes"),
        ("bound" in ends, "at-bound"),
        (_below_resolution(bench, trial), "below-resolution"),
        (refuted_by_reading(trial.full.model, trial.effect, bench.train), "contradicted-by-reading"),
        (not unlikely, "at-bound" if _at_any_bound(trial) else "not-significant"),
        (
            not trial.train_gain.total > min_relevant_reduction(*bench.sensitive_cost(before, trial.effect)),
            "immaterial",
        ),
    ]
    refused = next((reason for fails, reason in failed if fails), None)
    if refused is not None:
        return refused
    held = certain or _rarely_shown(trial, p_value) or _falls_under_discrepancy(bench, trial)
    return "supported" if held else "not-on-held-out"


def _falls_under_discrepancy(bench: DiagnosisData, trial: Candidate) -> bool:
    """Whether the cost of the data held out falls, though not for certain, and something unknown is left beside.

    What that does to few recordings is as large as what they show of an effect: how sure it is then is not a matter of
    a test, but of what it leaves there (:mod:`pneucli.diagnose.calibration`).
    """
    return trial.test_gain.total > 0.0 and bool(significant_lack_of_fit(*lack_of_fit(bench, trial.full)))


def _rarely_shown(trial: Candidate, p_value: float) -> bool:
    """Whether the data held out show the effect too rarely to be certain, do not contradict it, and the fitted are.

    Such as a break-away after a long rest: one or two blocks decide, and a bootstrap may draw neither.
    """
    return (
        trial.test_gain.effective_blocks < MIN_EFFECTIVE_BLOCKS
        and trial.test_gain.total > 0.0
        and trial.train_gain.significant
        and p_value < ALPHA_RARELY_SHOWN
    )


def _end_locations(trial: Candidate) -> list[Literal["null", "bound", "inside"]]:
    """Return where each parameter with a null ended: at its null, at another bound of what is plausible, or inside."""
    model, effect = trial.full.model, trial.effect
    upper = {f.name: f.upper for f in trial.full.fit.free}
    names = {f"{effect.name}.{p.name}": p for p in effect.in_model_with(model.effects).parameters}
    values = {name: absent_value(p, model, upper.get(name, math.inf)) for name, p in names.items()}
    nulls = {name: value for name, value in values.items() if value is not None}
    return [
        "null" if np.isclose(e.value, nulls[e.name], rtol=1e-5, atol=0.0) else "bound" if e.at_bound else "inside"
        for e in trial.full.fit.estimates
        if e.name in nulls
    ]


def _at_any_bound(trial: Candidate) -> bool:
    return any(e.at_bound and e.name.startswith(f"{trial.effect.name}.") for e in trial.full.fit.estimates)


def min_relevant_reduction(cost: float, samples: int) -> float:
    """Return by how much a cost of so many residuals must fall for it to matter."""
    return (MIN_COST_SHARE_AT_NOISE if _cost_at_noise_floor(cost, samples) else MIN_COST_SHARE) * cost


def is_at_noise_floor(state: FittedModel) -> bool:
    """Whether sensors' noise alone would leave about as much."""
    return _cost_at_noise_floor(state.cost, state.residual_count)


def _cost_at_noise_floor(cost: float, samples: int) -> bool:
    return cost < NOISE_COST_RATIO * samples


def _below_resolution(bench: DiagnosisData, trial: Candidate) -> bool:
    """Whether the effect is but a time that the sampling cannot tell from none."""
    period = max(view.experiment.recording.period for view in bench.train)
    times = [
        trial.full.model.values[f"{trial.effect.name}.{p.name}"]
        for p in trial.effect.parameters
        if p.unit == "s" and p.null == 0.0
    ]
    return len(times) == len(trial.effect.parameters) and all(abs(t) < MIN_RESOLVED_PERIODS * period for t in times)
