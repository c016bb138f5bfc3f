"""What became of an effect, and why: written down where it is decided, and only printed afterwards."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pneucli.diagnose.data import Candidate
from pneucli.physics.declaration import Effect

Reason = Literal[
    "supported",  # all tests passed
    "cannot-show",  # no recording feels it, or none would at any plausible size
    "not-promising",  # the screen promises no more than chance, or far less than of others: not fitted
    "vanishes",  # fitted, it takes the value at which it is absent
    "at-bound",  # fitted, it stands at the bound of what is plausible
    "below-resolution",  # a time that the sampling cannot tell from none
    "not-significant",  # chance does as much in the family of all that was looked for
    "immaterial",  # sure or not, it takes too little
    "not-on-held-out",  # what it takes off fitted data it does not take off data that were not fitted
    "raises-error",  # the error of the comparison, which the user sees, rises
    "needless",  # it passed alone, and beside what was taken nothing is left for it
    "contradicted-by-reading",  # samples at a known pressure refute the fault of a sensor
    "explained-by-unknown",  # something unknown remains, and it may but stand in for that
    "explained-by-signal",  # a function of one signal, without a name, stands better in its place
]


@dataclass(frozen=True)
class Decision:
    """One effect and its reason; ``candidate`` is None where it was not fitted."""

    effect: Effect
    reason: Reason
    candidate: Candidate | None = None

    @property
    def supported(self) -> bool:
        """Whether the effect passed."""
        return self.reason == "supported"


def supported_candidates(decisions: list[Decision]) -> list[Candidate]:
    """Return the trials that are supported."""
    return [d.candidate for d in decisions if d.supported and d.candidate is not None]
