"""Which effect leads a round: what is added next to the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pneucli.diagnose.adequacy import too_much
from pneucli.diagnose.calibration import NAMED
from pneucli.diagnose.candidate import Reason, passed
from pneucli.diagnose.data import Bench, Trial, remains
from pneucli.diagnose.equivalence import Place, foremost
from pneucli.diagnose.hypothesis_tests import at_noise
from pneucli.diagnose.posterior import lawful, likely, standing
from pneucli.diagnose.screening import Round


def leading(bench: Bench, decisions: Round) -> tuple[Trial | None, Round]:
    """Return the foremost trial that passes and that the user sees the good of, and what is decided with that."""
    while able := passed(decisions):
        first = _first(bench, able)
        refused = "explained-by-unknown" if hides(bench, first) else unseen(bench, first)
        if refused is None:
            return first, decisions
        decisions = [replace(d, reason=refused) if d.trial is first else d for d in decisions]
    return None, decisions


def _first(bench: Bench, able: Sequence[Trial]) -> Trial:
    """Return the trial that leaves least; where even that leaves something unknown, the one likeliest to be there.

    What leaves least is no better then: a spring of a tenth of its usual stiffness far from its rest is a force.
    """
    first = foremost(bench, able)
    if len(able) == 1 or not too_much(*remains(bench, first.state)):
        return first
    ranked = [first, *(t for t in able if t is not first)]
    places = [Place(t, tuple(other for other in able if other is not t)) for t in ranked]
    return best_placed(bench, max(places, key=lambda place: likely(bench, place)))


def best_placed(bench: Bench, place: Place) -> Trial:
    """Return what stands best of the named effect and of what leaves as much in its place, beside something unknown."""
    return max([place.named, *place.alike(bench, complete=False)], key=lambda t: standing(bench, t))


def hides(bench: Bench, trial: Trial) -> bool:
    """Whether an effect that states bounds leaves a force over, any of which would stay hidden within them.

    But not one that is likelier there than not, by what else it explains.
    """
    left = too_much(*remains(bench, trial.state)) if trial.effect.bounds else []
    return not lawful(trial.effect, left) and likely(bench, Place(trial, ())) < NAMED


def unseen(bench: Bench, trial: Trial) -> Reason | None:
    """Return why the error that the user sees speaks against a trial, None where it does not.

    Where no more than noise is left, it must fall by more than chance moves it: a sure and tiny effect is one that the
    rig's description, the smoothing or the clock may have as well.
    """
    if spoils(bench, trial):
        return "raises-error"
    return "immaterial" if at_noise(trial.before) and not bench.lowers(trial.before, trial.state) else None


def spoils(bench: Bench, trial: Trial) -> bool:
    """Whether a trial raises the error that the user sees.

    What readings show alone does not: what is unknown besides may have leant on it, as a piston's friction on a bias of
    its accelerometer.
    """
    return bench.raises(trial.before, trial.state) and not Place(trial, ()).read_alone(bench)
