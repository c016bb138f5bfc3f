"""Selection of a set of effects: add the most probable one, again and again, then drop what is improbable."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

from pneucli.diagnose.adequacy import LackOfFit
from pneucli.diagnose.calibration import Evidence, probability
from pneucli.diagnose.candidate import Candidate, Decision, Reason, supported_candidates
from pneucli.diagnose.constraints import (
    IMPOSSIBLE,
    MIN_ERROR_RISE,
    at_any_bound,
    error_ratio,
    lowers_error,
    raises_error_beyond_noise,
    raises_held_out_error,
    violations_of_estimate,
)
from pneucli.diagnose.data import CONVERGED_COST_RATIO, DiagnosisData, Refit, ScreenedEffect, lack_of_fit
from pneucli.diagnose.decision import Judgement, is_complete, judge, log_odds_among_equivalents
from pneucli.diagnose.equivalence import Term, best_candidate, not_inferior
from pneucli.diagnose.evidence import holm_adjusted
from pneucli.diagnose.score import FittedModel
from pneucli.memory import release_free_memory
from pneucli.physics.declaration import Effect

ALPHA = 0.02  # rate at which a healthy rig yields any candidate


def apply_tests(data: DiagnosisData, candidates: Sequence[Candidate]) -> list[Decision]:
    """Decide on each candidate of one model: is its estimate valid, and does it lower the cost significantly?

    Where the model leaves only noise, that counts in the family of all hypotheses. Where an unmodelled effect acts,
    chance alone is no rival: the probability weighs how many resemble it, and few blocks of an effect that explains
    nearly all of a channel would not outweigh a family.
    """
    p_values = [c.p_value for c in candidates]
    if candidates and is_complete(data, candidates[0].reduced):
        p_values = holm_adjusted(p_values, max(data.hypothesis_count, len(candidates)))
    return [Decision(c.effect, _reason(data, c, p), c) for c, p in zip(candidates, p_values, strict=True)]


def _reason(data: DiagnosisData, candidate: Candidate, p_value: float) -> Reason:
    """Return why a candidate passes or fails. Its end location comes before its p value, which a bound distorts."""
    failed: list[tuple[bool, Reason]] = [
        *violations_of_estimate(data, candidate),
        (candidate.full.cost >= candidate.reduced.cost, "not-significant"),  # a law with bounds may fit and cost more
        (not p_value < ALPHA, "at-bound" if at_any_bound(candidate) else "not-significant"),
    ]
    return next((reason for fails, reason in failed if fails), "supported")


MAX_BY_SHARE, MAX_BY_GAIN = 3, 2  # effects that are refitted in one round, by each of the two rankings
MIN_CHI2 = 12.0  # predicted reduction of the cost, chi-square with one degree of freedom: p = 1/2000
MIN_RELATIVE_SHARE = 0.01  # of the largest predicted share


def score_test_screen(
    data: DiagnosisData, fitted: FittedModel, screened: Sequence[ScreenedEffect]
) -> tuple[list[ScreenedEffect], list[ScreenedEffect]]:
    """Return the effects to refit, those with the largest predicted shares and those with the largest gains, and those
    to refit where none of them passes: as many with the next shares.

    The share is the predicted reduction over the cost of the residuals that the effect influences. Without it a
    friction effect would lose against effects on gas and valve wherever those residuals are 20 times their noise. By
    the gain itself an effect leads that removes a little of all residuals. What another effect hides, the next round
    finds.
    """
    promising = [(s[0].gain / data.sensitive_cost(fitted, e)[0], (e, s)) for e, s in screened if s[0].gain > MIN_CHI2]
    promising.sort(key=lambda one: -one[0])
    by_share = [pair for share, pair in promising if share > MIN_RELATIVE_SHARE * promising[0][0]]
    by_gain = sorted(by_share, key=lambda pair: -pair[1][0].gain)[:MAX_BY_GAIN]
    first = [pair for i, pair in enumerate(by_share) if i < MAX_BY_SHARE or pair in by_gain]
    return first, [pair for pair in by_share if pair not in first][:MAX_BY_SHARE]


Decisions = list[Decision]  # about the effects that a model lacks


def screen_and_refit(
    data: DiagnosisData, fitted: FittedModel, excluded: Sequence[str] = (), reference: FittedModel | None = None
) -> Decisions:
    """Decide on every effect that the model lacks; the refitted ones come first.

    ``excluded`` effects are not considered. ``reference`` is a further model that the candidates compete with.
    """
    first, second = score_test_screen(
        data, fitted, [(e, s) for e, s in data.ranked_signatures(fitted) if e.name not in excluded]
    )
    decided = _refit_and_test(data, fitted, first, reference)
    # several of the first may be one another's twins, and none what is missing: a play hid behind three leaks
    if reference is None and decided and not supported_candidates(decided):
        decided += _refit_and_test(data, fitted, second, reference)
    known = {*excluded, *(d.effect.name for d in decided)}
    return decided + [Decision(e, "not-promising") for e in data.absent_effects(fitted.model) if e.name not in known]


def refit_twins(data: DiagnosisData, full: FittedModel, candidate: Candidate, tried: Decisions) -> Decisions:
    """Decide on the twins of a candidate's effect, by its declaration, that ``tried`` has not refitted in its place.

    They look like it, so what else is missing may hide them from a screen. ``full`` is the model they compete with.
    """
    refitted = {d.effect.name for d in tried if d.candidate is not None}
    twins = [
        (e, s)
        for e, s in data.ranked_signatures(candidate.reduced)
        if e.name.partition(":")[0] in candidate.effect.twins and e.name not in refitted and s[0].gain > MIN_CHI2
    ]
    return _refit_and_test(data, candidate.reduced, twins, full)


def _refit_and_test(
    data: DiagnosisData, fitted: FittedModel, screened_in: Sequence[ScreenedEffect], reference: FittedModel | None
) -> Decisions:
    candidates = data.refit_with(fitted, [effect for effect, _ in screened_in], [tests for _, tests in screened_in])
    rivals = [*(c.full for c in candidates), *([reference] if reference else [])]
    cost_limit = CONVERGED_COST_RATIO * min((rival.cost for rival in rivals), default=0.0)
    converged = data.refit_to_convergence([c for c in candidates if c.full.cost < cost_limit])
    refitted = {c.effect.name: c for c in [*candidates, *converged]}
    return apply_tests(data, sorted(refitted.values(), key=lambda c: c.full.cost))


MAX_EFFECTS = 4
MIN_PROMISING = 0.05  # probability of one of four effects that explain all together, at a third of its typical size
NO_RISE = (False, MIN_ERROR_RISE)
# reasons that leave open whether an effect is there in a small amount
IMPROBABLE: tuple[Reason, ...] = ("needless", "immaterial", "explained-by-unknown")


class Kept(NamedTuple):
    """The model in which every added effect is probable given the others, the judgement of each, and those of the
    dropped ones.
    """

    last: FittedModel
    judgements: Mapping[str, Judgement]
    refused: Sequence[Judgement]


@dataclass(frozen=True)
class SelectionPath:
    """The selection path: ``models`` from the given model to the last, each with one effect more.

    ``terms`` has the term of every added effect and ``judgements`` what is said of it; ``refused`` are judgements of
    effects that were added and then dropped; ``decisions`` has one decision for each other screened effect.
    ``alternatives`` are the last model with one effect more, which passes the tests and is not probable enough to be
    named.
    """

    models: tuple[FittedModel, ...]
    terms: Mapping[str, Term]
    judgements: Mapping[str, Judgement]
    refused: tuple[Judgement, ...]
    decisions: tuple[Decision, ...]
    train: tuple[LackOfFit, ...]
    test: tuple[LackOfFit, ...]
    alternatives: tuple[FittedModel, ...] = ()

    @property
    def last(self) -> FittedModel:
        """The model with all added effects."""
        return self.models[-1]

    @property
    def added(self) -> list[str]:
        """The added effects in the order of the path, which may differ from that of the last model."""
        return [
            next(n for n in after.effect_names if n not in before.effect_names)
            for before, after in pairwise(self.models)
        ]


def select_effects(data: DiagnosisData, base: FittedModel) -> SelectionPath:
    """Select the effects that explain the lack of fit of ``base``.

    Where a rival in place of one of them leaves noise alone and they do not, the rival is taken: of two explanations of
    the same readings the one that these contradict is no explanation.
    """
    path, rounds, unpromising = _forward(data, base)
    found = _selected(data, base, path, rounds, unpromising)
    if not found.terms or is_complete(data, found.last):
        return found
    rivals = [c for term in found.terms.values() for c in term.rivals if is_complete(data, c.full)]
    return _selected(data, base, [base, best_candidate(rivals).full], rounds, unpromising) if rivals else found


def _selected(
    data: DiagnosisData,
    base: FittedModel,
    path: Sequence[FittedModel],
    rounds: Sequence[Decisions],
    unpromising: Sequence[Judgement],
) -> SelectionPath:
    """Return the selection path of what is probable among the effects of the last model of ``path``."""
    last, judgements, dropped_ones = _without_improbable(data, path)
    refused = [*unpromising, *dropped_ones]
    models, unguessable = _nested_models(data, base, last, path)
    last = models[-1]
    terms = _terms(data, base, last, rounds[0], judgements)
    train, test = lack_of_fit(data, last)
    dropped = [j.decision for j in refused] + [Decision(e, "cannot-show") for e in unguessable]
    decisions = final_decisions(rounds, dropped, list(terms), complete=is_complete(data, last))
    passed = [d for each in rounds for d in each if d.supported] + dropped
    return SelectionPath(
        models=tuple(models),
        terms=terms,
        judgements={name: judgements[name] for name in terms},
        refused=tuple(refused),
        decisions=decisions,
        train=tuple(train),
        test=tuple(test),
        alternatives=_alternatives(last, passed, decisions),
    )


def unsearched_path(data: DiagnosisData, base: FittedModel) -> SelectionPath:
    """Return the path of the given model alone, without a search."""
    train, test = lack_of_fit(data, base)
    return SelectionPath((base,), {}, {}, (), (), tuple(train), tuple(test))


def final_decisions(
    rounds: Sequence[Decisions], refused: Sequence[Decision], names: Sequence[str], *, complete: bool
) -> tuple[Decision, ...]:
    """Return one decision for each screened effect that is not among ``names``.

    A refusal after the addition counts first, then the first fit, which is against the most incomplete model. An effect
    that passed and was not added resembles an unmodelled one; in a ``complete`` model it is needless beside other
    effects, or else immaterial.
    """
    unnamed: Reason = "explained-by-unknown" if not complete else "needless" if names else "immaterial"
    decided = [d for each in rounds for d in each]
    ranked = [*refused, *(d for d in decided if d.candidate is not None), *(d for d in decided if d.candidate is None)]
    found: dict[str, Decision] = {}
    for d in ranked:
        if d.effect.name not in names:
            found.setdefault(d.effect.name, replace(d, reason=unnamed) if d.supported else d)
    return tuple(found.values())


def _forward(data: DiagnosisData, base: FittedModel) -> tuple[list[FittedModel], list[Decisions], list[Judgement]]:
    """Return the path of added effects from ``base``, the decisions of each round, and the judgement of an effect that
    ends the path.

    While an unmodelled effect remains, the search goes on past improbable ones: where several effects are missing, each
    may look improbable until the others are there. It ends at one that promises less than ``MIN_PROMISING``.
    """
    path, rounds = [base], list[Decisions]()
    while len(path) <= MAX_EFFECTS:
        best, decisions = _next_round(data, path[-1])
        rounds.append(_without_derivatives(data, decisions, rounds))
        release_free_memory()
        if best is None:
            break
        if not _promises(judge(data, best).evidence):
            return path, rounds, [judge(data, Term(best.candidate, ()), constrained=True, error_may_rise=True)]
        path.append(best.candidate.full)
    return path, rounds, []


def _promises(evidence: Evidence) -> bool:
    """Return whether an effect may be probable beside others that are still to come, which may narrow its interval."""
    return probability(evidence._replace(significance=math.inf)) >= MIN_PROMISING


def _next_round(data: DiagnosisData, fitted: FittedModel) -> tuple[Term | None, Decisions]:
    """Return the most probable effect with its rivals, None where none passes, and what is decided on all."""
    decisions = screen_and_refit(data, fitted)
    candidates = supported_candidates(decisions)
    if is_complete(data, fitted):
        candidates = [c for c in candidates if judge(data, Term(c, ())).decision.supported]
    if not candidates:
        return None, decisions
    return _among(candidates, _most_probable(data, candidates)), decisions


def _without_derivatives(data: DiagnosisData, decisions: Decisions, earlier: Sequence[Decisions]) -> Decisions:
    """Return the decisions of a round without what nothing will ask for; derivatives of all fits fill the memory.

    Of each effect the first fit is reported and each one that passes is an alternative, but only an effect that passes
    in the first round may be named in place of another.
    """
    reported = {d.effect.name for each in earlier for d in each if d.candidate is not None}
    new = [d for d in decisions if d.supported or d.effect.name not in reported]
    return [d if d.supported and not earlier else data.without_derivatives(d) for d in new]


def _most_probable(data: DiagnosisData, candidates: Sequence[Candidate]) -> Candidate:
    """Return the candidate with the lowest cost if it is probable and leaves only noise, or else the most probable one.

    With an unmodelled effect the lowest cost means little: a spring of a tenth of its usual stiffness, far from its
    rest position, is a constant force.
    """
    first = best_candidate(candidates)
    if len(candidates) == 1 or (is_complete(data, first.full) and judge(data, Term(first, ())).decision.supported):
        return first
    ranked = [first, *(c for c in candidates if c is not first)]
    best = max((_among(candidates, c) for c in ranked), key=lambda term: judge(data, term).probability)
    others = best.equivalents(data, complete=False)
    if others and judge(data, best).decision.supported:  # none that would be refused in the end takes its place
        others = [c for c in others if judge(data, Term(c, ())).decision.supported]
    if not others:  # else it would ask for free runs
        return best.candidate
    equivalents = [best.candidate, *others]
    top = max(equivalents, key=lambda c: log_odds_among_equivalents(data, c))
    return best_candidate([c for c in equivalents if not_inferior(c.full, top.full) and not_inferior(top.full, c.full)])


def _among(candidates: Sequence[Candidate], one: Candidate) -> Term:
    """Return one of the candidates with the others as its rivals."""
    return Term(one, tuple(other for other in candidates if other is not one))


def _alternatives(
    last: FittedModel, passed: Sequence[Decision], decisions: Sequence[Decision]
) -> tuple[FittedModel, ...]:
    """Return the fits with one effect more than the last model, among those that passed the tests once, without the
    effects that ``decisions`` refuse for certain.
    """
    possible, names = {d.effect.name for d in decisions if d.reason in IMPROBABLE}, set(last.effect_names)
    candidates = [d.candidate for d in passed if d.candidate is not None and d.effect.name in possible]
    return tuple(c.full for c in candidates if set(c.reduced.effect_names) == names)


def _without_improbable(data: DiagnosisData, path: Sequence[FittedModel]) -> Kept:
    """Drop improbable effects from the last model of the path.

    A proxy that was added last may take what an earlier effect explains, and be dropped after it. So effects are also
    dropped from an earlier model of the path that costs less than what is left, and the lower cost counts; but from
    none with an effect that was impossible beside the later ones: that one was the proxy.
    """
    known, first_fits = {frozenset(one.effect_names): one for one in path}, set[frozenset[str]]()
    kept = _without_some(data, path, known, first_fits)
    refuted = {j.decision.effect.name for j in kept.refused if j.decision.reason in IMPOSSIBLE}
    for end in range(len(path) - 1, 1, -1):
        if path[end - 1].cost < kept.last.cost and refuted.isdisjoint(path[end - 1].effect_names):
            other = _without_some(data, path[:end], known, first_fits)
            kept = _with_refused(other, kept.refused) if other.last.cost < kept.last.cost else kept
    return kept


def _with_refused(kept: Kept, earlier: Sequence[Judgement]) -> Kept:
    """Return what is kept with the judgements of effects that were only in a larger model."""
    judged = {*kept.judgements, *(j.decision.effect.name for j in kept.refused)}
    return kept._replace(refused=[*kept.refused, *(j for j in earlier if j.decision.effect.name not in judged)])


def _without_some(
    data: DiagnosisData,
    path: Sequence[FittedModel],
    known: dict[frozenset[str], FittedModel],
    first_fits: set[frozenset[str]],
) -> Kept:
    """Drop improbable effects, and those that raise the error unless the model that is left then errs more.

    Each of several effects may raise the error, or make another one do so, while all together lower it.
    """
    kept = _dropped(data, path, known, first_fits, error_may_rise=False)
    if all(j.decision.reason != "raises-error" for j in kept.refused):
        return kept
    lenient = _dropped(data, path, known, first_fits, error_may_rise=True)
    return lenient if lowers_error(data, kept.last, lenient.last) else kept


def _dropped(
    data: DiagnosisData,
    path: Sequence[FittedModel],
    known: dict[frozenset[str], FittedModel],
    first_fits: set[frozenset[str]],
    *,
    error_may_rise: bool,
) -> Kept:
    """Drop the least probable effect, again and again, until all are probable: a proxy of an unmodelled effect takes
    cost from the others. ``known`` are fits by the names of their effects, to which others are added; those that only
    rank are among ``first_fits``. A fit of the path may have ended in a local minimum that one more effect led out of:
    it is fitted once more from there.
    """
    last, refused, on_path = path[-1], list[Judgement](), {frozenset(one.effect_names) for one in path[1:]}
    while added := [data.effects[name] for name in last.effect_names if name not in path[0].effect_names]:
        names = [frozenset(last.effect_names) - {effect.name} for effect in added]
        open_sets = [(k, effect) for k, effect in zip(names, added, strict=True) if k not in known or k in on_path]
        refits = data.refit_without(last, [effect for _, effect in open_sets])
        found = {
            k: one for (k, _), one in zip(open_sets, refits, strict=True) if k not in known or one.cost < known[k].cost
        }
        known.update(found)
        first_fits.update(found)
        on_path.difference_update(names)
        terms = [Term(data.candidate(known[key], last, one), ()) for key, one in zip(names, added, strict=True)]
        judged = [judge(data, term) for term in terms]
        # the least probable one that may not stay goes, whatever is found of the others: that asks for their free runs
        for i in sorted(range(len(terms)), key=lambda i: (judged[i].probability, known[names[i]].cost)):
            judged[i] = judge(data, terms[i], constrained=True, error_may_rise=error_may_rise)
            if not judged[i].decision.supported:
                break
        else:
            if not error_may_rise:
                judged = [_without_rise(data, j, known[key], last) for j, key in zip(judged, names, strict=True)]
        refusable = [i for i, j in enumerate(judged) if not j.decision.supported]
        if not refusable:
            return Kept(last, {j.decision.effect.name: j for j in judged}, refused)
        worst = min(refusable, key=lambda i: (judged[i].probability, known[names[i]].cost))
        refused.append(judged[worst])
        reduced = known[names[worst]]
        if names[worst] in first_fits and reduced.cost >= CONVERGED_COST_RATIO * last.cost:
            (reduced,) = data.run_refits(data, [Refit("converge", reduced, added[worst])])
            known[names[worst]] = reduced
            first_fits.remove(names[worst])
        last = reduced
    return Kept(last, {}, refused)


def _without_rise(data: DiagnosisData, judged: Judgement, reduced: FittedModel, full: FittedModel) -> Judgement:
    """Refuse an effect that raises the error by more than noise moves it, unless channels of its own measure it."""
    decision = judged.decision
    assert decision.candidate is not None
    if not raises_error_beyond_noise(data, reduced, full) or Term(decision.candidate, ()).is_measured_exclusively(data):
        return judged
    return replace(judged, decision=replace(decision, reason="raises-error"))


def _nested_models(
    data: DiagnosisData, base: FittedModel, last: FittedModel, path: Sequence[FittedModel]
) -> tuple[list[FittedModel], list[Effect]]:
    """Return the models from base to last, the effect with the largest reduction first that does not raise the error.

    Where one rises within chance, another order is shown; where all do, the effect that raises it least is the first.

    The second result has effects without an initial guess at every step, which are left out.
    """
    if path[-1] is last and all(_rise(data, *step) == NO_RISE for step in pairwise(path)):
        return list(path), []
    models, remaining = [base], [e for e in last.model.effects if e.name not in base.effect_names]
    while len(remaining) > 1:
        addable = [e for e in remaining if data.has_initial_guess(models[-1], e)]
        if not addable:
            return models, remaining
        ranked = sorted(data.refit_with(models[-1], addable), key=lambda c: c.full.cost)
        first = min(ranked, key=lambda c: _rise(data, c.reduced, c.full))
        models.append(first.full)
        remaining.remove(first.effect)
    return [*models, last] if remaining else models, []


def _rise(data: DiagnosisData, reduced: FittedModel, full: FittedModel) -> tuple[bool, float]:
    """Return whether an effect raises the held-out error by more than chance, and by which factor, at least that of
    ``NO_RISE``.
    """
    return raises_held_out_error(data, reduced, full), max(error_ratio(data, reduced, full), MIN_ERROR_RISE)


def _terms(
    data: DiagnosisData,
    base: FittedModel,
    last: FittedModel,
    first_round: Decisions,
    judgements: Mapping[str, Judgement],
) -> dict[str, Term]:
    """Return the term of each added effect, with the candidates that pass in its place.

    ``first_round`` are the decisions at the base model, which lacks a single effect where one was added.
    """
    terms: dict[str, Term] = {}
    names = [name for name in last.effect_names if name not in base.effect_names]
    for name in names:
        candidate = judgements[name].decision.candidate
        assert candidate is not None
        decisions = first_round if len(names) == 1 else screen_and_refit(data, candidate.reduced, [name], last)
        twins = refit_twins(data, last, candidate, decisions)
        rivals = tuple(c for c in supported_candidates([*decisions, *twins]) if c.effect.name != name)
        terms[name] = Term(candidate, rivals)
    return terms
