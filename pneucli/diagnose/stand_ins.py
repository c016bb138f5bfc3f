"""Beside something unknown: which effects are there, and which only stand in for it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pneucli.diagnose.evidence import disagreement
from pneucli.diagnose.remainder import Remainder
from pneucli.diagnose.trial import Bench, State

MUCH = 3.5  # times the expected rms: where so much is left, more than one thing acts
EXPLAINS = 0.25  # of what exceeds noise, where much is left
EXPLAINS_MOST = 0.95  # the same where little is left: an effect that resembles one unknown would leave little too
EXPLAINS_ALONE = 0.9  # the same where no recording was held out to contradict it
DISAGREE = 0.5  # of an effect's size: recordings that want it changed by more do not show this effect


def stands(bench: Bench, last: State, left: Sequence[Remainder], name: str, before: State, after: State) -> bool:
    """Whether the effect added from ``before`` to ``after`` is more than a stand-in for what ``left`` shows.

    It took its share of what exceeds noise, the recordings agree on its size, it states a law where something is left,
    and the error of the ladder falls.
    """
    share = explained(before, after)
    if not bench.held_out:
        enough = share > EXPLAINS_ALONE
    else:
        enough = share > EXPLAINS_MOST or (share > EXPLAINS and left[0].ratio > MUCH)
    return enough and agreed(bench, last, name) and lawful(bench, name, left) and bench.falls(before, after)


def lawful(bench: Bench, name: str, left: Sequence[Remainder]) -> bool:
    """Whether an effect states a force wherever one is left over; bounds alone would keep any force within them."""
    return not (bench.effects[name].bounds and any(r.kind.states_force for r in left))


def agreed(bench: Bench, state: State, name: str) -> bool:
    """Whether the fitted recordings agree on an effect's size."""
    names = [view.experiment.recording.name for view in bench.train]
    sizes = [view.experiment.time.size * len(view.channels) for view in bench.train]
    recordings = np.repeat(np.unique(names, return_inverse=True)[1], sizes)
    return disagreement(state.fit, bench.effects[name], recordings) < DISAGREE


def explained(before: State, after: State) -> float:
    """Return the share of what exceeds noise that a step takes away, on fitted and on held-out recordings."""
    return (before.cost - after.cost) / max(before.cost - before.samples, 1e-9)
