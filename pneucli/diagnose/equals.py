"""Of effects that explain the data alike: which one to name, and which are told beside it."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.diagnose.evidence import gain
from pneucli.diagnose.judge import material
from pneucli.diagnose.trial import Bench, State, Trial

ONE_PARAMETER = 3.84  # chi-square of one degree of freedom, exceeded by chance once in 20
SLIGHTLY = 0.05  # of the cost, and of what an effect takes of it


def foremost(bench: Bench, trials: Sequence[Trial]) -> Trial:
    """Return the trial that leaves least, or the simplest of those that leave as little.

    Of equals a sensor's fault comes last: sensors are calibrated, rigs are not. Bounds of a force hold as well as the
    law of it, and say little of how the piston moves: that must replay as well.
    """
    best = min(trials, key=lambda t: t.state.cost)
    alike = [t for t in trials if as_good(t.state, best.state) or simpler(t, best)]
    alike.sort(key=lambda t: (len(t.effect.parameters), _of_sensor(t), t.state.cost))
    return next(t for t in alike if not any(_bounds_stray(bench, t, other) for other in alike))


def _bounds_stray(bench: Bench, trial: Trial, other: Trial) -> bool:
    """Whether a trial states bounds of a force and replays far worse than another does."""
    return trial.effect.bounds and bench.strays(other.state, trial.state)


def _of_sensor(trial: Trial) -> bool:
    return trial.effect.part == "sensor"


def as_good(state: State, best: State) -> bool:
    """Whether the data cannot tell that ``state`` explains them less well than ``best``.

    It costs no more for certain or, in units of the variance that is left, no more than one parameter takes up by
    chance: twins differ by the last digits of their fits, which is certain in every block.
    """
    more = state.cost - best.cost
    within_chance = more < ONE_PARAMETER * max(best.cost / max(best.samples, 1), 1.0)
    return within_chance or not gain(state.costs, best.costs).certain


def simpler(trial: Trial, best: Trial) -> bool:
    """Whether a trial has fewer parameters and leaves no more than does not matter.

    However certain: one parameter more takes up what the true law leaves of the rig's imperfections.
    """
    more = trial.state.cost - best.state.cost
    matters = min(material(best.state.cost, best.state.samples), SLIGHTLY * (trial.before.cost - trial.state.cost))
    return len(trial.effect.parameters) < len(best.effect.parameters) and more < matters


def equal(rival: Trial, best: State) -> bool:
    """Whether the data cannot tell an effect's rival from it, where noise alone is left.

    It is as good, or costs so little more that what is known of the noise and of the state at each restart does not
    decide.
    """
    more, gained = rival.state.cost - best.cost, rival.before.cost - rival.state.cost
    return as_good(rival.state, best) or more < SLIGHTLY * min(best.cost, gained + more)
