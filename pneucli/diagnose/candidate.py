"""A candidate effect, and the decision about it with its reason.

Where each reason is decided: the table "Reasons" of docs/development/internals.md; where it is worded:
:mod:`pneucli.messages.diagnose`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pneucli.diagnose.score import FittedModel
from pneucli.physics.declaration import Effect

Reason = Literal[
    "supported",  # the candidate passed all tests
    "cannot-show",  # no residual is sensitive to the effect, or no plausible size would have been detected
    "not-promising",  # the score test predicts no more than chance, or far less than others; the effect was not fitted
    "vanishes",  # the fit ended at the value at which the effect is absent
    "replaces-base-parameter",  # it changes the residuals as a parameter does that the base model has
    "at-bound",  # the fit ended at a bound of the plausible range
    "below-resolution",  # the sampling cannot distinguish the fitted time from zero
    "not-significant",  # not significant in the family of all hypotheses
    "interval-contains-null",  # the 95 % interval contains the value at which the effect is absent
    "immaterial",  # only noise is left, and the reduction is too small to make the effect probable
    "raises-error",  # the free-run error of the comparison rises with the effect
    "needless",  # it passed by itself, and adds nothing to the selected effects
    "contradicted-by-reading",  # samples at a known pressure refute the fault of a sensor
    "explained-by-unknown",  # an unmodelled effect remains, and this effect probably only resembles it
]


@dataclass(frozen=True)
class Candidate:
    """The step from the ``reduced`` to the ``full`` model by one effect.

    ``p_value`` is that of its parameters, not adjusted for the family; ``replaces`` names the base parameters that the
    data do not distinguish from it.
    """

    effect: Effect
    reduced: FittedModel
    full: FittedModel
    p_value: float
    replaces: tuple[str, ...] = ()


@dataclass(frozen=True)
class Decision:
    """One effect and its reason; ``candidate`` is None where the effect was not fitted."""

    effect: Effect
    reason: Reason
    candidate: Candidate | None = None

    @property
    def supported(self) -> bool:
        """Whether the effect passed."""
        return self.reason == "supported"


def supported_candidates(decisions: list[Decision]) -> list[Candidate]:
    """Return the candidates that are supported."""
    return [d.candidate for d in decisions if d.supported and d.candidate is not None]
