"""An effect in its place beside the others that were found: what it leaves there, and what is not told from it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pneucli.diagnose.equals import ONE_PARAMETER, equal
from pneucli.diagnose.judge import NOISE
from pneucli.diagnose.trial import Bench, State, Trial
from pneucli.physics.declaration import Effect

LEAST = 0.005  # of what there was: what is left beyond noise is not known better
INDEPENDENT = 10  # readings, as which what is unknown besides counts (docs/method.md)
BY_CHANCE = math.exp(ONE_PARAMETER / INDEPENDENT)  # the ratio of what two leave that is no more than chance


def _no_less(left: float, mine: float) -> bool:
    """Whether what one leaves is no more than what another does, and what it takes no less, but for chance."""
    return left < BY_CHANCE * mine and BY_CHANCE * (1.0 - left) > 1.0 - mine


@dataclass(frozen=True)
class Place:
    """One effect of the last model: ``named``, the step to it from the model without, and what passed all tests there
    in its place.
    """

    named: Trial
    rivals: tuple[Trial, ...]

    def alike(self, bench: Bench, *, complete: bool) -> list[Trial]:
        """Return the rivals that the data cannot tell from the named effect.

        Where it is not ``complete``, what is left is no noise that would average out, but a few independent readings of
        something unknown: of two that leave about as much of what the named one acts in, and take about as much, the
        one may be ahead by chance. What explains more of something else is no rival there.
        """
        if complete:
            return [t for t in self.rivals if equal(t, self.named.state)]
        mine = self.left(bench)
        return [t for t in self.rivals if _no_less(self.left(bench, t), mine)]

    def read_alone(self, bench: Bench) -> bool:
        """Whether readings show such an effect alone, and show anything of it: a direct reading beats an inference."""
        return bool(self._left(bench.alone, self.named.state))

    def left(self, bench: Bench, trial: Trial | None = None) -> float:
        """Return the part of the squares beyond noise that a trial leaves there, the named one if none is given.

        Of readings that show such an effect alone, where there are such (:meth:`read_alone`). Else of what the named
        effect acts in. Of the fitted recordings or of those held out, of which it leaves more: a stand-in takes up the
        ones and not the others.
        """
        after = (trial or self.named).state
        left = self._left(bench.alone, after) or self._left(bench.parts, after)
        return min(max([LEAST, *left]), 1.0 / LEAST) if left else 1.0

    def _left(self, parts: Callable[[State, Effect], Sequence[tuple[float, float]]], after: State) -> list[float]:
        """Return what a state leaves of each part in which more than noise was."""
        pairs = zip(parts(self.named.before, self.named.effect), parts(after, self.named.effect), strict=True)
        return [(end - n) / (start - n) for (start, n), (end, _) in pairs if start > NOISE * n]
