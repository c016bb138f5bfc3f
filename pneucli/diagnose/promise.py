"""Which effects are worth a fit: those whose signatures promise most of what they act in."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.diagnose.trial import Bench, Screened, State

REFITS = 6  # of the effects that promise most
WORTH = 12.0  # the fall of the cost that a signature must promise: a chi-square that chance gives once in 2000
HOPELESS = 0.01  # of the share that the best signature promises


def promising(bench: Bench, state: State, screened: Sequence[Screened]) -> list[Screened]:
    """Return the effects whose best signatures promise most, the best first.

    What counts is the share of what they act in: where gas and valve are 20 times their noise off, all that friction
    may explain is less than a hundredth of all.
    """
    worth = [(s[0].gain / bench.felt(state, e)[0], (e, s)) for e, s in screened if s[0].gain > WORTH]
    worth.sort(key=lambda one: -one[0])
    return [pair for share, pair in worth[:REFITS] if share > HOPELESS * worth[0][0]]
