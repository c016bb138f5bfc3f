"""Beside something unknown: how sure an effect is, and whether it is named."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.adequacy import Remainder, too_much
from pneucli.diagnose.calibration import NAMED, Evidence, probability
from pneucli.diagnose.candidate import Decision, Reason
from pneucli.diagnose.data import Bench, State, Trial, remains
from pneucli.diagnose.equivalence import INDEPENDENT, Place, outdone
from pneucli.diagnose.evidence import disagreement, magnitude, significance
from pneucli.diagnose.free_run_error import taken_away
from pneucli.diagnose.hypothesis_tests import supported
from pneucli.diagnose.validity import contradicted
from pneucli.identify.residuals import Chambers, Forces, Imposed, Inferred, View
from pneucli.physics.declaration import Effect
from pneucli.simulate.rig_quantities import facts_of

Weighed = tuple[Decision, Evidence]

MUCH = 3.5  # times the expected rms: where so much is left, more than one thing acts
EXPLAINS = 0.25  # of what exceeds noise, where much is left
EXPLAINS_MOST = 0.95  # the same where little is left: an effect that resembles one unknown would leave little too
EXPLAINS_ALONE = 0.9  # the same where no recording was held out to contradict it
CERTAIN = 1e-6  # no effect is there, or absent, with less doubt
DISAGREE = 0.5  # of an effect's size: recordings that want it changed by more do not show this effect


def weighed(
    bench: Bench,
    last: State,
    trial: Trial,
    left: Sequence[Remainder],
    place: Place | None,
    alike: Sequence[str] = (),
) -> Weighed:
    """Return the decision about an effect that was added, and what it rests on, its ``place`` in the last model too.

    What is more likely a stand-in for something unknown is not named; where no exam tells how likely that is, only
    beside something that is ``left``. ``alike`` are the effects that the data cannot tell from it.
    """
    evidence = evidence_of(bench, last, trial, place, alike, complete=not left)
    failed: list[tuple[bool, Reason]] = [
        (contradicted(trial.state.model, trial.effect, bench.train), "contradicted-by-reading"),
        (unseen_force(bench.train, trial.effect), "cannot-show"),
        (not _known(bench, last, trial, left, evidence), "explained-by-unknown"),
        (bool(left) and not _good(bench, trial, place), "raises-error"),
    ]
    reason: Reason = next((why for fails, why in failed if fails), "supported")
    if reason == "supported" and place is not None and _outdone(bench, place):
        reason = "explained-by-signal"
    return Decision(trial.effect, reason, trial), evidence


def _known(bench: Bench, last: State, trial: Trial, left: Sequence[Remainder], evidence: Evidence) -> bool:
    """Whether an effect is likelier there than absent; where no exam tells, whether it takes enough of what is left."""
    if examined(bench, trial.effect):
        return probability(evidence) >= NAMED
    if not left:
        return True
    share, agree = explained(trial.before, trial.state), agreement(bench, last, trial.effect.name)
    return lawful(trial.effect, left) and told(bench, share, agree, left)


def _outdone(bench: Bench, place: Place) -> bool:
    """Whether a law of one signal stands better in an effect's place, of what no readings show alone."""
    return not place.read_alone(bench) and outdone(bench, place) is not None


def without_refused(bench: Bench, last: State, weights: Sequence[Weighed], left: Sequence[Remainder]) -> list[Weighed]:
    """Return what is decided about the effects of the ``last`` model, named only what is good without those refused.

    The user will not add those. So a force on the piston may undo what an offset of its pressure does there, which
    stands in for something unknown; by itself it is nothing.
    """
    refused = [d.effect for d, _ in weights if not d.supported]
    stood_in = any(d.reason == "explained-by-signal" for d, _ in weights)
    if not (left or stood_in) or not refused or len(refused) == len(weights):
        return list(weights)
    for effect in refused:
        (last,) = bench.without(last, [effect])
    now = left or too_much(*remains(bench, last))
    return [_held(bench, last, one, now, same=bool(left) or not now) if one[0].supported else one for one in weights]


def _held(bench: Bench, last: State, known: Weighed, left: Sequence[Remainder], *, same: bool) -> Weighed:
    """Return what is known of a named effect, or what the named model says of it where it does not pass there.

    So too where it is not the ``same``: beside what was taken for noise something is left without those refused.
    """
    effect = known[0].effect
    (before,) = bench.without(last, [effect])
    place = Place(bench.trial(before, last, effect), ())
    stays = bool(supported(bench, before, [place.named])) and _good(bench, place.named, place)
    return known if stays and same else weighed(bench, last, place.named, left, place, known[1].effects[1:])


def _good(bench: Bench, trial: Trial, place: Place | None) -> bool:
    """Whether the error that the user sees falls, as a rung of the ladder or in its place beside all others.

    Or readings show the effect alone, which need no such proof.
    """
    if bench.falls(trial.before, trial.state) or place is None:
        return bench.falls(trial.before, trial.state)
    return bench.falls(place.named.before, place.named.state) or place.read_alone(bench)


def lawful(effect: Effect, left: Sequence[Remainder]) -> bool:
    """Whether an effect states a force wherever one is left over; bounds alone would keep any force within them."""
    return not (effect.bounds and any(r.kind.states_force for r in left))


def unseen_force(views: Sequence[View], effect: Effect) -> bool:
    """Whether an effect shows only in balances of forces of which a pressure that acts on the piston was not recorded.

    Chamber 2 is shut or driven and p2 is missing: its force is missing too, and a spring would stand in for it.
    """
    felt = [view for view in views if view.feels(effect)]
    return bool(felt) and all(lacks_p2(view) for view in felt)


def lacks_p2(view: View) -> bool:
    """Whether a view is of the forces on a piston of whose shut or driven chamber 2 no pressure was recorded."""
    return type(view) is Forces and view.experiment.lacks_p2


def examined(bench: Bench, effect: Effect) -> bool:
    """Whether exams have recordings of this kind: only there is the law of the probability known.

    They have no force alone, and always a recording that was held out.
    """
    return bench.checked and all(
        type(view) in (Chambers, Forces, Imposed, Inferred) for view in bench.train if view.feels(effect)
    )


def told(bench: Bench, share: float, disagreement: float, left: Sequence[Remainder]) -> bool:
    """Whether an effect is more than a stand-in where no exam tells: it takes most, or much is left beside it."""
    if disagreement > DISAGREE and bench.checked:
        return False
    if not bench.checked:
        return share > EXPLAINS_ALONE
    return share > EXPLAINS_MOST or (share > EXPLAINS and left[0].ratio > MUCH)


def evidence_of(
    bench: Bench, last: State, trial: Trial, place: Place | None, alike: Sequence[str] = (), *, complete: bool
) -> Evidence:
    """Return what tells the effect of a trial, as it is in the ``last`` state, from a stand-in.

    ``alike``: effects that the data cannot tell from it. ``complete``: the last state leaves nothing but noise.
    """
    share = None if bench.shown is None else taken_away(bench.shown(trial.before.model), bench.shown(trial.state.model))
    left = 1.0 if place is None else place.left(bench)
    sure, size = _sure_and_size(bench, last, trial.effect)
    return Evidence(share, sure, size, complete, left, imposed(bench, trial.effect), (trial.effect.name, *alike))


def likely(bench: Bench, place: Place) -> float:
    """Return the probability that an effect, in its place beside others and something unknown, is there.

    Or one of those in its place that the data cannot tell from it.
    """
    alike = [t.effect.name for t in place.alike(bench, complete=False)]
    return probability(evidence_of(bench, place.named.state, place.named, place, alike, complete=False))


def standing(bench: Bench, trial: Trial) -> float:
    """Return the log of how likely a trial is against others that leave as much in its place.

    Its odds, whatever effect it is: the unknown that one of them resembles, all of them do; and one that is larger than
    usual is no likelier than its twin. And what is left of the error that the user sees, as so many independent
    readings: a balance of forces has few break-aways, and a trajectory hangs on them.
    """
    evidence = evidence_of(bench, trial.state, trial, Place(trial, ()), complete=False)
    alone = evidence._replace(share=None, size=min(evidence.size, 1.0), effects=())
    p = min(max(probability(alone), CERTAIN), 1.0 - CERTAIN)
    errors = [] if bench.shown is None else [e for e in bench.shown(trial.state.model).values() if e]
    return math.log(p / (1.0 - p)) - INDEPENDENT * (float(np.mean(np.log(errors))) if errors else 0.0)


def imposed(bench: Bench, effect: Effect) -> bool:
    """Whether an effect acts in nothing but recordings whose motion is imposed and whose force is measured."""
    return all(type(view) is Imposed for view in bench.train if view.feels(effect))


def _sure_and_size(bench: Bench, state: State, effect: Effect) -> tuple[float, float]:
    facts = facts_of(state.model, [view.experiment for view in bench.train])
    return significance(state.fit, effect), magnitude(state.fit, effect, facts)


def agreement(bench: Bench, state: State, name: str) -> float:
    """Return by which part of its size single recordings want an effect changed; of one alone, its quarters."""
    names = [view.experiment.recording.name for view in bench.train]
    alone, number = len(set(names)) == 1, np.unique(names, return_inverse=True)[1]
    parts = [_quarters(view) if alone else np.full(_size(view), i) for view, i in zip(bench.train, number, strict=True)]
    return disagreement(state.fit, bench.effects[name], np.concatenate(parts))


def _size(view: View) -> int:
    return view.experiment.time.size * len(view.channels)


def _quarters(view: View) -> NDArray[np.int64]:
    """Return the quarter of the recording in which each residual stands."""
    n = view.experiment.time.size
    return np.tile(np.arange(n) * 4 // n, len(view.channels))


def explained(before: State, after: State) -> float:
    """Return the share of what exceeds noise that a step takes away, on fitted and on held-out recordings."""
    return (before.cost - after.cost) / max(before.cost - before.samples, 1e-9)
