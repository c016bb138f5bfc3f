"""Beside something unknown: how sure an effect is, and whether it is named."""

from __future__ import annotations

import numpy as np

from pneucli.diagnose.confidence import NAMED, Evidence, probability
from pneucli.diagnose.decision import Decision, Reason
from pneucli.diagnose.evidence import disagreement
from pneucli.diagnose.known import contradicted
from pneucli.diagnose.smooth import Left, strongest
from pneucli.diagnose.trial import Bench, State, Trial


def weighed(bench: Bench, last: State, trial: Trial, *, unknown: bool) -> tuple[Decision, Evidence]:
    """Return the decision about an effect that was added, and what it rests on.

    Where something ``unknown`` is left, what is more likely a stand-in for that is not named.
    """
    evidence = evidence_of(bench, last, trial, clear=not unknown)
    reason: Reason = "supported"
    if contradicted(trial.state.model, trial.effect, bench.train):
        reason = "contradicted-by-reading"
    elif unknown and probability(evidence) < NAMED:
        reason = "explained-by-unknown"
    elif unknown and not bench.falls(trial.before, trial.state):
        reason = "raises-error"
    return Decision(trial.effect, reason, trial), evidence


def evidence_of(bench: Bench, last: State, trial: Trial, *, clear: bool) -> Evidence:
    """Return what tells the effect of a trial from a stand-in; ``clear`` where nothing is left."""
    gain = trial.before.cost - trial.state.cost
    smooth = strongest(Left.by(trial.before, bench.train, bench.held_out), trial.effect, trial.before)
    return Evidence(
        explained(trial.before, trial.state),
        agreement(bench, last, trial.effect.name),
        smooth.gain / max(gain, 1e-9) if smooth else 0.0,
        gain / max(trial.state.every.samples, 1),
        clear,
    )


def agreement(bench: Bench, state: State, name: str) -> float:
    """Return by which part of its size single recordings want an effect changed."""
    names = [view.experiment.recording.name for view in bench.train]
    sizes = [view.experiment.time.size * len(view.channels) for view in bench.train]
    recordings = np.repeat(np.unique(names, return_inverse=True)[1], sizes)
    return disagreement(state.fit, bench.effects[name], recordings)


def explained(before: State, after: State) -> float:
    """Return the share of what exceeds noise that a step takes away, on fitted and on held-out recordings."""
    return (before.every.total - after.every.total) / max(before.every.beyond_noise, 1e-9)
