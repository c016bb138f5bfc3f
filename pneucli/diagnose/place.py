"""An effect in its place beside the others that were found: what it leaves there, and what is not told from it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pneucli.diagnose.equals import ONE_PARAMETER, equal
from pneucli.diagnose.judge import NOISE
from pneucli.diagnose.trial import Bench, Trial

LEAST = 0.005  # of what there was: what is left beyond noise is not known better
INDEPENDENT = 10  # readings, as which what is unknown besides counts (docs/diagnosis.md)


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
        something unknown: of two that leave about as much the one may be ahead by chance.
        """
        chance = 0.0 if complete else math.exp(ONE_PARAMETER / INDEPENDENT)
        return [
            t
            for t in self.rivals
            if equal(t, self.named.state, noise_alone=complete) or self.left(bench, t) < chance * self.left(bench)
        ]

    def left(self, bench: Bench, trial: Trial | None = None) -> float:
        """Return the part of the squares beyond noise that a trial leaves there, the named one if none is given.

        Of readings that show such an effect alone, where they show anything of it: a direct reading beats an inference.
        Else of what the named effect acts in. Of the fitted recordings or of those held out, of which it leaves more: a
        stand-in takes up the ones and not the others.
        """
        effect, before, after = self.named.effect, self.named.before, (trial or self.named).state
        for parts in (bench.alone, bench.parts):
            pairs = zip(parts(before, effect), parts(after, effect), strict=True)
            left = [(end - n) / (start - n) for (start, n), (end, _) in pairs if start > NOISE * n]
            if left:
                return min(max([LEAST, *left]), 1.0 / LEAST)
        return 1.0
