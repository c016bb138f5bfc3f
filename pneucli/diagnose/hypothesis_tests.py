"""The tests that a trial must pass to be supported, and the reason where it does not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from pneucli.diagnose.adequacy import too_much
from pneucli.diagnose.candidate import Decision, Reason, passed
from pneucli.diagnose.data import Bench, State, Trial, remains
from pneucli.diagnose.evidence import holm
from pneucli.diagnose.validity import contradicted
from pneucli.identify.estimation.parameters import absent_value

ALPHA = 0.02  # of naming any effect where none is, before it is held out
SURE = 1e-4  # the same for what shows so rarely that the data held out cannot be certain
FEW = 5.0  # blocks in which it shows there
MATERIAL = 0.004  # of the cost: less does not change what the user sees
AT_NOISE = 0.02  # the same where noise is left: the laws of the base, smoothing and clock err by as much
RESOLUTION = 0.5  # of a sampling period: a time shorter than this may be the clock's, or the model's own step
NOISE = 1.05  # times as much as sensors' noise alone would leave


def judged(bench: Bench, before: State, trials: Sequence[Trial]) -> list[Decision]:
    """Decide on each trial: significant in the family of all, material, and held by data not seen?"""
    adjusted = holm([t.p_value for t in trials], max(bench.hypotheses, len(trials)))
    return [Decision(t.effect, _reason(bench, before, t, p), t) for t, p in zip(trials, adjusted, strict=True)]


def supported(bench: Bench, before: State, trials: Sequence[Trial]) -> list[Trial]:
    """Return the trials that pass all tests."""
    return passed(judged(bench, before, trials))


def _reason(bench: Bench, before: State, trial: Trial, p_value: float) -> Reason:
    """Return why a trial passes or not; where it ended comes before chance, which a bound distorts."""
    ends = _ends(trial)
    unlikely, certain = p_value < ALPHA, trial.test.certain or not bench.checked
    failed: list[tuple[bool, Reason]] = [
        (bool(ends) and set(ends) == {"null"}, "vanishes"),
        ("bound" in ends, "at-bound"),
        (_too_short(bench, trial), "below-resolution"),
        (contradicted(trial.state.model, trial.effect, bench.train), "contradicted-by-reading"),
        (not unlikely, "at-bound" if _at_any_bound(trial) else "not-significant"),
        (not trial.train.total > material(*bench.felt(before, trial.effect)), "immaterial"),
    ]
    refused = next((reason for fails, reason in failed if fails), None)
    if refused is not None:
        return refused
    held = certain or _rarely_shown(trial, p_value) or _falls_beside(bench, trial)
    return "supported" if held else "not-on-held-out"


def _falls_beside(bench: Bench, trial: Trial) -> bool:
    """Whether the cost of the data held out falls, though not for certain, and something unknown is left beside.

    What that does to few recordings is as large as what they show of an effect: how sure it is then is not a matter of
    a test, but of what it leaves there (:mod:`pneucli.diagnose.calibration`).
    """
    return trial.test.total > 0.0 and bool(too_much(*remains(bench, trial.state)))


def _rarely_shown(trial: Trial, p_value: float) -> bool:
    """Whether the data held out show the effect too rarely to be certain, do not contradict it, and the fitted are.

    Such as a break-away after a long rest: one or two blocks decide, and a bootstrap may draw neither.
    """
    return trial.test.number < FEW and trial.test.total > 0.0 and trial.train.certain and p_value < SURE


def _ends(trial: Trial) -> list[Literal["null", "bound", "inside"]]:
    """Return where each parameter with a null ended: at its null, at another bound of what is plausible, or inside."""
    model, effect = trial.state.model, trial.effect
    upper = {f.name: f.upper for f in trial.state.fit.free}
    names = {f"{effect.name}.{p.name}": p for p in effect.parameters}
    values = {name: absent_value(p, model, upper.get(name, math.inf)) for name, p in names.items()}
    nulls = {name: value for name, value in values.items() if value is not None}
    return [
        "null" if np.isclose(e.value, nulls[e.name], rtol=1e-5, atol=0.0) else "bound" if e.at_bound else "inside"
        for e in trial.state.fit.estimates
        if e.name in nulls
    ]


def _at_any_bound(trial: Trial) -> bool:
    return any(e.at_bound and e.name.startswith(f"{trial.effect.name}.") for e in trial.state.fit.estimates)


def material(cost: float, samples: int) -> float:
    """Return by how much a cost of so many residuals must fall for it to matter."""
    return (AT_NOISE if _noise_alone(cost, samples) else MATERIAL) * cost


def at_noise(state: State) -> bool:
    """Whether sensors' noise alone would leave about as much."""
    return _noise_alone(state.cost, state.samples)


def _noise_alone(cost: float, samples: int) -> bool:
    return cost < NOISE * samples


def _too_short(bench: Bench, trial: Trial) -> bool:
    """Whether the effect is but a time that the sampling cannot tell from none."""
    period = max(view.experiment.recording.period for view in bench.train)
    times = [
        trial.state.model.values[f"{trial.effect.name}.{p.name}"]
        for p in trial.effect.parameters
        if p.unit == "s" and p.null == 0.0
    ]
    return len(times) == len(trial.effect.parameters) and all(abs(t) < RESOLUTION * period for t in times)
