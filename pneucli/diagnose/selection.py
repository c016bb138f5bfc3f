"""Selection of a set of effects: forward steps, backward elimination, and pairs where no single effect is supported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from pneucli.diagnose.adequacy import LackOfFit, significant_lack_of_fit
from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY
from pneucli.diagnose.candidate import Candidate, Decision, supported_candidates
from pneucli.diagnose.data import DiagnosisData, lack_of_fit
from pneucli.diagnose.decision import posterior_probability
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.evidence import score_gain
from pneucli.diagnose.hypothesis_tests import min_relevant_reduction, passing_candidates
from pneucli.diagnose.next_term import next_term, raises_free_run_error
from pneucli.diagnose.score import FittedModel
from pneucli.diagnose.screening import Decisions, screen_and_refit
from pneucli.identify.estimation.score_test import ScoreTest
from pneucli.physics.declaration import Effect

MAX_EFFECTS = 4
MAX_PAIRS = 3


@dataclass(frozen=True)
class SelectionPath:
    """The selection path: ``models`` from the given model to the last, each with one effect more.

    ``terms`` has the term of every added effect; ``decisions`` has one decision for each other screened effect;
    ``improbable`` are those of them that were added and then dropped as more probably absent.
    """

    models: tuple[FittedModel, ...]
    terms: dict[str, Term]
    decisions: tuple[Decision, ...]
    train: tuple[LackOfFit, ...]
    test: tuple[LackOfFit, ...]
    improbable: tuple[Candidate, ...] = ()

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

    @property
    def adequate(self) -> bool:
        """Whether the last model has no significant lack of fit."""
        return not significant_lack_of_fit(self.train, self.test)


def select_effects(data: DiagnosisData, base: FittedModel) -> SelectionPath:
    """Select the effects that explain the lack of fit of ``base``."""
    path, rounds = _forward(data, [base], [])
    if len(path) <= 2 and significant_lack_of_fit(*lack_of_fit(data, path[-1])):
        path, rounds = _pairs(data, path, rounds)
    path, terms, refused = _revise(data, path, rounds)
    last = path[-1]
    improbable = [d for d in refused if d.reason == "explained-by-unknown" and d.effect.name not in last.effect_names]
    train, test = lack_of_fit(data, last)
    return SelectionPath(
        models=tuple(path),
        terms=terms,
        decisions=final_decisions(rounds, refused, last.effect_names),
        improbable=tuple(d.candidate for d in improbable if d.candidate is not None),
        train=tuple(train),
        test=tuple(test),
    )


def unsearched_path(data: DiagnosisData, base: FittedModel) -> SelectionPath:
    """Return the path of the given model alone, without a search."""
    train, test = lack_of_fit(data, base)
    return SelectionPath((base,), {}, (), tuple(train), tuple(test))


def final_decisions(
    rounds: Sequence[Decisions], refused: Sequence[Decision], names: Sequence[str]
) -> tuple[Decision, ...]:
    """Return one decision for each screened effect that is not among ``names``.

    A refusal after the addition counts first, then the first fit, which is against the most incomplete model. An effect
    that passed and is not in the last model is needless there: the last round found no use for it.
    """
    decided = [d for each in rounds for d in each]
    ranked = [*refused, *(d for d in decided if d.candidate is not None), *(d for d in decided if d.candidate is None)]
    found: dict[str, Decision] = {}
    for d in ranked:
        if d.effect.name not in names:
            found.setdefault(d.effect.name, replace(d, reason="needless") if d.supported else d)
    return tuple(found.values())


def _forward(
    data: DiagnosisData, path: list[FittedModel], rounds: list[Decisions]
) -> tuple[list[FittedModel], list[Decisions]]:
    while len(path) <= MAX_EFFECTS:
        added, decisions = next_term(data, screen_and_refit(data, path[-1]))
        rounds.append(decisions)
        if added is None:
            break
        path.append(added.full)
    return path, rounds


def _revise(
    data: DiagnosisData, path: list[FittedModel], rounds: list[Decisions]
) -> tuple[list[FittedModel], dict[str, Term], Decisions]:
    """Drop effects that are not needed besides later ones.

    Returns the path, the term of each effect, and the decisions about the dropped effects.
    """
    base = path[0]
    path, without, refused = _pruned(data, base, path)
    return path, _terms(data, base, path[-1], rounds[0], without), refused


def _pruned(
    data: DiagnosisData, base: FittedModel, path: list[FittedModel]
) -> tuple[list[FittedModel], dict[str, FittedModel], Decisions]:
    """Return the path without dropped effects, the models without single effects of the last, and the decisions.

    The path before a dropped effect is restored if that effect had made others needless.
    """
    last, needless, without = _without_needless(data, base, path[-1])
    last, without = _with_whole_effects(data, base, last, without)
    reordered, raising = _reordered_path(data, base, last, path)
    before = [fitted for fitted in path if not {d.effect.name for d in raising} & set(fitted.effect_names)]
    if raising and len(before) > len(reordered):
        return before, {}, raising
    return reordered, without if reordered[-1] is last else {}, needless + raising


def _terms(
    data: DiagnosisData,
    base: FittedModel,
    last: FittedModel,
    first_round: Decisions,
    without: Mapping[str, FittedModel],
) -> dict[str, Term]:
    """Return the term of each added effect, with the candidates that pass in its place.

    ``first_round`` are the decisions at the base model, which lacks a single effect where one was added. ``without``
    has models that lack a single effect.
    """
    terms: dict[str, Term] = {}
    names = last.effect_names[len(base.effect_names) :]
    for name in names:
        reduced = base if len(names) == 1 else without.get(name)
        before = data.refit_without(last, [data.effects[name]])[0] if reduced is None else reduced
        decisions = first_round if len(names) == 1 else screen_and_refit(data, before, [name], last)
        rivals = tuple(c for c in supported_candidates(decisions) if c.effect.name != name)
        terms[name] = Term(data.candidate(before, last, data.effects[name]), rivals)
    return terms


def _without_needless(
    data: DiagnosisData, base: FittedModel, last: FittedModel
) -> tuple[FittedModel, Decisions, dict[str, FittedModel]]:
    """Return the model after backward elimination, the decisions, and its models that lack a single effect, by name."""
    refused: Decisions = []
    without: dict[str, FittedModel] = {}
    while len(names := last.effect_names[len(base.effect_names) :]) > 1:
        effects = [data.effects[name] for name in names]
        without = dict(zip(names, data.refit_without(last, effects), strict=True))
        weakest = _least_needed(data, last, [data.candidate(without[e.name], last, e) for e in effects])
        if weakest is None:
            break
        refused.append(weakest)
        last = without[weakest.effect.name]
    return last, refused, without


def _with_whole_effects(
    data: DiagnosisData, base: FittedModel, last: FittedModel, without: dict[str, FittedModel]
) -> tuple[FittedModel, dict[str, FittedModel]]:
    """Return the model with an effect of both chambers in place of the same at each, and the models without an effect.

    It replaces them where the data cannot tell: two equal hoses are one delay, with a parameter fewer.
    """
    added = [data.effects[name] for name in last.effect_names if name not in base.effect_names]
    for first in (e for e in added if e.side == 1):
        name = first.name.removesuffix(":1")
        second = next((e for e in added if e.name == f"{name}:2"), None)
        if second is None or name not in data.effects:
            continue
        (without_first,) = data.refit_without(last, [first])
        (reduced,) = data.refit_without(without_first, [second])
        whole = data.refit_to_convergence(data.refit_with(reduced, [data.effects[name]]))
        pair = Term(data.candidate(reduced, last, data.effects[name]), tuple(whole))
        if pair.equivalents(data, complete=not significant_lack_of_fit(*lack_of_fit(data, last))):
            last, without = whole[0].full, {}
    return last, without


def _least_needed(data: DiagnosisData, last: FittedModel, candidates: Sequence[Candidate]) -> Decision | None:
    """Return the effect to drop next, None where all are needed.

    With an unmodelled effect present it is the least probable effect, if that is more probably absent: it takes cost
    from the others, which then seem needless. Otherwise it is the cheapest to drop of the effects that are not
    supported given the others, unless the cost would rise by a certain and material amount: such an effect may support
    the others.
    """
    if significant_lack_of_fit(*lack_of_fit(data, last)):
        probability, improbable = min(
            ((posterior_probability(data, Term(c, ())), c) for c in candidates), key=lambda each: each[0]
        )
        if probability < MIN_NAMED_PROBABILITY:
            return Decision(improbable.effect, "explained-by-unknown", improbable)
    needless = [
        c for c in candidates if not passing_candidates(data, c.reduced, [c]) and not _is_missed(c.reduced, last)
    ]
    weakest = min(needless, key=lambda c: c.reduced.cost, default=None)
    return None if weakest is None else Decision(weakest.effect, "needless", weakest)


def _is_missed(before: FittedModel, last: FittedModel) -> bool:
    gain = score_gain(before.costs, last.costs)
    return gain.significant and gain.total > min_relevant_reduction(before.cost, before.residual_count)


def _reordered_path(
    data: DiagnosisData, base: FittedModel, last: FittedModel, original: Sequence[FittedModel]
) -> tuple[list[FittedModel], Decisions]:
    """Return the models from base to last, the effect with the largest reduction first, and the effects left out.

    No step may raise the free-run error: an effect that does so wherever it is added is left out, and so is an effect
    that has no initial guess at any step.
    """
    if original[-1] is last and not any(
        data.free_run_error_rises(before, after) for before, after in pairwise(original)
    ):
        return list(original), []
    path, refused = [base], []
    remaining = [e for e in last.model.effects if e.name not in base.effect_names]
    while remaining:
        ended = len(remaining) == 1
        addable = [e for e in remaining if ended or data.has_initial_guess(path[-1], e)]
        candidates = [data.candidate(path[-1], last, addable[0])] if ended else data.refit_with(path[-1], addable)
        passing = [c for c in candidates if not raises_free_run_error(data, c)]
        if not passing:
            refused += [Decision(c.effect, "raises-error", c) for c in candidates]
            refused += [Decision(e, "cannot-show") for e in remaining if e not in addable]
            break
        first = min(passing, key=lambda c: c.full.cost)
        path.append(first.full)
        remaining.remove(first.effect)
    return path, refused


def _pairs(
    data: DiagnosisData, path: list[FittedModel], rounds: list[Decisions]
) -> tuple[list[FittedModel], list[Decisions]]:
    """Try pairs where no single effect is supported: each of the best candidates with the most promising second one.

    The parameters of a model that lacks two effects compensate for both, which hides the signature of each. Sets that
    the last round has fitted are skipped.
    """
    base, last = path[0], path[-1]
    fitted_sets = [{*last.effect_names, d.effect.name} for d in rounds[-1] if d.candidate is not None]
    refitted = [d.candidate for d in rounds[0] if d.candidate is not None and d.effect.name not in last.effect_names]
    best = path
    for first in sorted(refitted, key=lambda c: float(c.full.train_costs.sum()))[:MAX_PAIRS]:
        for other, tests in data.ranked_signatures(first.full)[:1]:
            if {*first.full.effect_names, other.name} in fitted_sets:
                continue
            pair_path = _pair_path(data, base, first, other, tests)
            if pair_path is not None and score_gain(best[-1].costs, pair_path[-1].costs).significant:
                best = pair_path
    if best is path:
        return path, rounds
    return _forward(data, best, rounds[:1])


def _pair_path(
    data: DiagnosisData, base: FittedModel, first: Candidate, other: Effect, tests: Sequence[ScoreTest]
) -> list[FittedModel] | None:
    """Return the path over both effects, where each is supported given the other.

    Where the pair leaves an unmodelled effect, both must be probable, too.
    """
    (second,) = data.refit_with(first.full, [other], [tests])
    if not passing_candidates(data, first.full, [second]):
        return None
    (without,) = data.refit_without(second.full, [first.effect])
    first_given_second = data.candidate(without, second.full, first.effect)
    if not passing_candidates(data, without, [first_given_second]):
        return None
    is_improbable = (
        min(posterior_probability(data, Term(c, ())) for c in (second, first_given_second)) < MIN_NAMED_PROBABILITY
    )
    if is_improbable and significant_lack_of_fit(*lack_of_fit(data, second.full)):
        return None
    return [base, first.full, second.full]
