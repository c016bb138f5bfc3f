"""Which set of effects: forward, backward, and pairs where no single effect opens the way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from pneucli.diagnose.adequacy import LackOfFit, significant_lack_of_fit
from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY
from pneucli.diagnose.candidate import Decision, supported_candidates
from pneucli.diagnose.data import Candidate, DiagnosisData, FittedModel, lack_of_fit
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.evidence import score_gain
from pneucli.diagnose.hypothesis_tests import min_relevant_reduction, passing_candidates
from pneucli.diagnose.next_term import next_term, raises_free_run_error
from pneucli.diagnose.posterior import posterior_probability
from pneucli.diagnose.screening import Decisions, screen_and_refit
from pneucli.identify.estimation.score_test import ScoreTest
from pneucli.physics.declaration import Effect

MAX_EFFECTS = 4
MAX_PAIRS = 3


@dataclass(frozen=True)
class SelectionPath:
    """The way taken: ``models`` from the model as it is to the last, each with one effect more.

    ``terms`` holds every effect of the last model with what passed in its place; ``decisions`` what became of the
    others that were screened, one for each; ``improbable`` are those of them that were added and were likelier absent.
    """

    models: tuple[FittedModel, ...]
    terms: dict[str, Term]
    decisions: tuple[Decision, ...]
    train: tuple[LackOfFit, ...]
    test: tuple[LackOfFit, ...]
    improbable: tuple[Candidate, ...] = ()

    @property
    def last(self) -> FittedModel:
        """The model with all that was found."""
        return self.models[-1]

    @property
    def added(self) -> list[str]:
        """The effects found, in the order to add them: that of the rungs, which may not be that of the last model."""
        return [
            next(n for n in after.effect_names if n not in before.effect_names)
            for before, after in pairwise(self.models)
        ]

    @property
    def adequate(self) -> bool:
        """Whether nothing is left over beyond noise."""
        return not significant_lack_of_fit(self.train, self.test)


def select_effects(bench: DiagnosisData, base: FittedModel) -> SelectionPath:
    """Find the effects that explain what ``base`` leaves over."""
    rungs, rounds = _forward(bench, [base], [])
    if len(rungs) <= 2 and significant_lack_of_fit(*lack_of_fit(bench, rungs[-1])):
        rungs, rounds = _pairs(bench, rungs, rounds)
    rungs, places, refused = _revise(bench, rungs, rounds)
    last = rungs[-1]
    doubted = [d for d in refused if d.reason == "explained-by-unknown" and d.effect.name not in last.effect_names]
    train, test = lack_of_fit(bench, last)
    return SelectionPath(
        models=tuple(rungs),
        terms=places,
        decisions=final_decisions(rounds, refused, last.effect_names),
        improbable=tuple(d.candidate for d in doubted if d.candidate is not None),
        train=tuple(train),
        test=tuple(test),
    )


def final_decisions(
    rounds: Sequence[Decisions], refused: Sequence[Decision], names: Sequence[str]
) -> tuple[Decision, ...]:
    """Return the decision about each effect that was screened and is not among ``names``.

    What was ``refused`` after it was taken stays so; else the first fit decides, against the model that lacked most.
    What passed and is not in the last model is needless there: the last round found nothing left for it.
    """
    tried = [d for each in rounds for d in each]
    ranked = [*refused, *(d for d in tried if d.candidate is not None), *(d for d in tried if d.candidate is None)]
    found: dict[str, Decision] = {}
    for d in ranked:
        if d.effect.name not in names:
            found.setdefault(d.effect.name, replace(d, reason="needless") if d.supported else d)
    return tuple(found.values())


def _forward(
    bench: DiagnosisData, rungs: list[FittedModel], rounds: list[Decisions]
) -> tuple[list[FittedModel], list[Decisions]]:
    while len(rungs) <= MAX_EFFECTS:
        leader, decisions = next_term(bench, screen_and_refit(bench, rungs[-1]))
        rounds.append(decisions)
        if leader is None:
            break
        rungs.append(leader.full)
    return rungs, rounds


def _revise(
    bench: DiagnosisData, rungs: list[FittedModel], rounds: list[Decisions]
) -> tuple[list[FittedModel], dict[str, Term], Decisions]:
    """Drop what should not stay beside later additions.

    Returns the rungs, the place of each effect, and what was refused after it was taken.
    """
    base = rungs[0]
    rungs, without, refused = _pruned(bench, base, rungs)
    return rungs, _terms(bench, base, rungs[-1], rounds[0], without), refused


def _pruned(
    bench: DiagnosisData, base: FittedModel, rungs: list[FittedModel]
) -> tuple[list[FittedModel], dict[str, FittedModel], Decisions]:
    """Return the rungs without what should not stay, states without single effects of the last, and what was refused.

    What made others needless and may not stay itself gives them back.
    """
    last, needless, without = _without_needless(bench, base, rungs[-1])
    ladder, raising = _reordered_path(bench, base, last, rungs)
    before = [state for state in rungs if not {d.effect.name for d in raising} & set(state.effect_names)]
    if raising and len(before) > len(ladder):
        return before, {}, raising
    return ladder, without if ladder[-1] is last else {}, needless + raising


def _terms(
    bench: DiagnosisData, base: FittedModel, last: FittedModel, known: Decisions, less: Mapping[str, FittedModel]
) -> dict[str, Term]:
    """Return the place of each effect: with it what passes there in its stead.

    ``known`` is the round of the base, which lacks one effect alone where one was found; ``less`` are states without
    single effects.
    """
    places: dict[str, Term] = {}
    names = last.effect_names[len(base.effect_names) :]
    for name in names:
        alone = base if len(names) == 1 else less.get(name)
        before = bench.refit_without(last, [bench.effects[name]])[0] if alone is None else alone
        decisions = known if len(names) == 1 else screen_and_refit(bench, before, [name], last)
        rivals = tuple(t for t in supported_candidates(decisions) if t.effect.name != name)
        places[name] = Term(bench.candidate(before, last, bench.effects[name]), rivals)
    return places


def _without_needless(
    bench: DiagnosisData, base: FittedModel, last: FittedModel
) -> tuple[FittedModel, Decisions, dict[str, FittedModel]]:
    """Return the state without effects that should not stay beside the others, one after the other; and these.

    Returns, too, the states that lack one more, by its name, where more than one effect is left.
    """
    refused: Decisions = []
    without: dict[str, FittedModel] = {}
    while len(names := last.effect_names[len(base.effect_names) :]) > 1:
        effects = [bench.effects[name] for name in names]
        without = dict(zip(names, bench.refit_without(last, effects), strict=True))
        least = _least_needed(bench, last, [bench.candidate(without[e.name], last, e) for e in effects])
        if least is None:
            break
        refused.append(least)
        last = without[least.effect.name]
    return last, refused, without


def _least_needed(bench: DiagnosisData, last: FittedModel, trials: Sequence[Candidate]) -> Decision | None:
    """Return which of the last state's effects should go first, None where all should stay.

    Beside something unknown the least likely, if it is likelier absent: such a one takes from the others what is
    theirs, so that these are not missed. Then one that is not supported beside the others, the least missed; but what
    the data would certainly and noticeably miss stays: it may not be supported alone, and yet carry the others.
    """
    if significant_lack_of_fit(*lack_of_fit(bench, last)):
        chance, unlikely = min(
            ((posterior_probability(bench, Term(t, ())), t) for t in trials), key=lambda each: each[0]
        )
        if chance < MIN_NAMED_PROBABILITY:
            return Decision(unlikely.effect, "explained-by-unknown", unlikely)
    needless = [t for t in trials if not passing_candidates(bench, t.reduced, [t]) and not _is_missed(t.reduced, last)]
    least = min(needless, key=lambda t: t.reduced.cost, default=None)
    return None if least is None else Decision(least.effect, "needless", least)


def _is_missed(before: FittedModel, last: FittedModel) -> bool:
    missed = score_gain(before.costs, last.costs)
    return missed.significant and missed.total > min_relevant_reduction(before.cost, before.residual_count)


def _reordered_path(
    bench: DiagnosisData, base: FittedModel, last: FittedModel, known: Sequence[FittedModel]
) -> tuple[list[FittedModel], Decisions]:
    """Return the states from base to last, the effect that explains most first, and what no rung can take.

    No rung spoils the error that the user sees: what does so wherever it is added is left out, and what has no size to
    start from on any rung.
    """
    if known[-1] is last and not any(bench.free_run_error_rises(before, after) for before, after in pairwise(known)):
        return list(known), []
    rungs, refused = [base], []
    waiting = [e for e in last.model.effects if e.name not in base.effect_names]
    while waiting:
        ended = len(waiting) == 1
        here = [e for e in waiting if ended or bench.has_initial_guess(rungs[-1], e)]
        trials = [bench.candidate(rungs[-1], last, here[0])] if ended else bench.refit_with(rungs[-1], here)
        able = [t for t in trials if not raises_free_run_error(bench, t)]
        if not able:
            refused += [Decision(t.effect, "raises-error", t) for t in trials]
            refused += [Decision(e, "cannot-show") for e in waiting if e not in here]
            break
        first = min(able, key=lambda t: t.full.cost)
        rungs.append(first.full)
        waiting.remove(first.effect)
    return rungs, refused


def _pairs(
    bench: DiagnosisData, rungs: list[FittedModel], rounds: list[Decisions]
) -> tuple[list[FittedModel], list[Decisions]]:
    """Try pairs where single effects led nowhere: beside each of the best fits what promises most there.

    A base that lacks two bends to both, and hides the signature of the one under what the other bent. Pairs that the
    last round has fitted are known.
    """
    base, last = rungs[0], rungs[-1]
    known = [{*last.effect_names, d.effect.name} for d in rounds[-1] if d.candidate is not None]
    fitted = [d.candidate for d in rounds[0] if d.candidate is not None and d.effect.name not in last.effect_names]
    best = rungs
    for first in sorted(fitted, key=lambda t: float(t.full.train_costs.sum()))[:MAX_PAIRS]:
        for other, found in bench.ranked_signatures(first.full)[:1]:
            if {*first.full.effect_names, other.name} in known:
                continue
            way = _pair_path(bench, base, first, other, found)
            if way is not None and score_gain(best[-1].costs, way[-1].costs).significant:
                best = way
    if best is rungs:
        return rungs, rounds
    return _forward(bench, best, rounds[:1])


def _pair_path(
    bench: DiagnosisData, base: FittedModel, first: Candidate, other: Effect, found: Sequence[ScoreTest]
) -> list[FittedModel] | None:
    """Return the way over both effects, where each is supported beside the other.

    Where even both leave something unknown each must be likely, too.
    """
    (second,) = bench.refit_with(first.full, [other], [found])
    if not passing_candidates(bench, first.full, [second]):
        return None
    (without,) = bench.refit_without(second.full, [first.effect])
    beside = bench.candidate(without, second.full, first.effect)
    if not passing_candidates(bench, without, [beside]):
        return None
    stand_in = min(posterior_probability(bench, Term(t, ())) for t in (second, beside)) < MIN_NAMED_PROBABILITY
    if stand_in and significant_lack_of_fit(*lack_of_fit(bench, second.full)):
        return None
    return [base, first.full, second.full]
