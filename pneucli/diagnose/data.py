"""The data of a diagnosis: residual models, effects, refits, and the costs of fitted models."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import zip_longest
from typing import Literal
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.diagnose.adequacy import LackOfFit, held_out_lack_of_fit, lack_of_fit_by_channel
from pneucli.diagnose.candidate import Candidate, Decision
from pneucli.diagnose.evidence import (
    VisitedSet,
    gain_p_value,
    relative_effect_sizes,
    replaced_base_parameters,
    wald_p_value,
)
from pneucli.diagnose.score import (
    Bounds,
    ErrorsOfModel,
    FittedModel,
    RecordingCost,
    bounds_of,
    exclusive_channel_cost,
    fitted_costs,
    held_out_costs,
    log_variances,
)
from pneucli.diagnose.spline_regression import SplineRegression
from pneucli.experiments import Part
from pneucli.identify.estimation.blocks import GroupSums, block_labels, group_sums
from pneucli.identify.estimation.fit import Fit, StoppingRule, without_data
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_with_effect, fit_without, refit
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import absent_value
from pneucli.identify.estimation.score_test import ScoreTest, initial_guesses, score_tests
from pneucli.identify.residuals import ResidualModel
from pneucli.memory import filed, release_filed
from pneucli.messages import compare
from pneucli.messages.progress import fitting_progress, screening_progress
from pneucli.physics.declaration import Effect
from pneucli.simulate.model import Model, parameter_value
from pneucli.simulate.rig_quantities import rig_quantities


def folds_of(residual_models: Sequence[ResidualModel]) -> tuple[int, ...]:
    """Return the fold of each residual model, one fold a recording; nothing for a single recording."""
    names = [residual_model.experiment.recording.name for residual_model in residual_models]
    fold_of = {name: i for i, name in enumerate(dict.fromkeys(names))}
    return tuple(fold_of[name] for name in names) if len(fold_of) > 1 else ()


def leave_one_out_models(fit: Fit, residual_models: Sequence[ResidualModel], folds: Sequence[int]) -> list[Model]:
    """Return for each residual model the model fitted without its fold."""
    problem = LeastSquaresProblem(fit.model, residual_models, fit.free, fit.initial_state_sensitivities)
    sizes = [residual_model.experiment.time.size * len(residual_model.channels) for residual_model in residual_models]
    rows = np.repeat(np.asarray(folds), sizes)
    (sums,) = group_sums(fit.jacobian, fit.residual, [rows])
    models = {fold: problem.model_at(parameters_without(fit, problem, sums, fold)) for fold in set(folds)}
    return [models[fold] for fold in folds]


def parameters_without(fit: Fit, problem: LeastSquaresProblem, sums: GroupSums, fold: int) -> Array:
    """Return the fit's coordinates (k,) without a fold, from the scores and curvatures of each.

    Parameters that the remaining recordings do not identify keep their value. An effect's own parameters are shrunk to
    their null by one pseudo-observation of their size.
    """
    z = np.array([f.to_coordinate(parameter_value(fit.model, f.name)) for f in fit.free])
    if not z.size:
        return z
    scores, curvatures = (np.delete(one, fold, axis=0).sum(axis=0) for one in sums)
    prior = problem.prior_jacobian(z)
    sizes = _distances_from_null(fit, z)
    inverse_size = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes != 0.0)
    gradient = scores + prior.T @ problem.prior_residuals(z) + inverse_size
    curvature = curvatures + prior.T @ prior + np.diag(inverse_size**2)
    step = np.linalg.pinv(curvature, hermitian=True) @ gradient
    return np.asarray(np.clip(z - step, *problem.bounds()))


def _distances_from_null(fit: Fit, z: Array) -> Array:
    """Return the distance of each parameter of an effect from its null (k,), 0 where it has none."""
    effects = fit.model.effects
    declared = {f"{e.name}.{p.name}": p for e in effects for p in e.in_model_with(effects).parameters}
    nulls = [absent_value(declared[f.name], fit.model, f.upper) if f.name in declared else None for f in fit.free]
    return np.array([0.0 if n is None else c - f.to_coordinate(n) for n, f, c in zip(nulls, fit.free, z, strict=True)])


@dataclass(frozen=True)
class Refit:
    """A fit from ``base`` with ``effect`` added (from the score tests ``ranked``, if known), dropped, or until
    convergence.
    """

    kind: Literal["add", "drop", "converge"]
    base: FittedModel
    effect: Effect
    ranked: tuple[ScoreTest, ...] | None = None


RunRefits = Callable[["DiagnosisData", Sequence[Refit]], "list[FittedModel]"]


def run_locally(data: DiagnosisData, refits: Sequence[Refit]) -> list[FittedModel]:
    """Return the fitted models of some refits, one after another."""
    return [data.run_refit(task) for task in refits]


RANKING_EFFORT = StoppingRule(
    12, 5e-3
)  # of a first fit, which only ranks candidates: its cost is exact to half a percent
CONVERGED_COST_RATIO = 1.05  # times the lowest cost: models within it are refitted to convergence before the comparison
PRESSURE_SENSOR_SIDES = frozenset(
    {"pressure sensor"}
)  # the balance in which faults of a pressure sensor act; they need a recorded pressure
ScreenedEffect = tuple[Effect, list[ScoreTest]]
LackOfFitByUse = tuple[list[LackOfFit], list[LackOfFit]]


@dataclass(frozen=True)
class DiagnosisData:
    """The data of a diagnosis: residual models of fitted and of held-out recordings, and the effects of the catalogue.

    Without held-out recordings ``folds`` has the fold of each fitted residual model (:func:`folds_of`).
    ``modelled_parts``: parts whose effects the valve's model contains already. ``base_effects``: names of the effects
    of the given model. ``free_run_errors``: the error of ``compare`` by use. ``implausible``: the recordings cannot be
    true, so nothing is looked for in them. ``run_refits``: does independent refits, perhaps in parallel. ``judge_fit``
    judges the printed error of a fitted model.
    """

    train: Sequence[ResidualModel]
    held_out: Sequence[ResidualModel]
    effects: Mapping[str, Effect]
    modelled_parts: frozenset[Part] = frozenset()
    base_effects: tuple[str, ...] = ()
    progress: Callable[[str], None] = field(default=lambda _: None)
    folds: tuple[int, ...] = ()
    free_run_errors: ErrorsOfModel | None = None
    implausible: bool = False
    run_refits: RunRefits = run_locally
    judge_fit: Callable[[Fit], compare.LackOfFit | None] = field(default=lambda _: None)

    @cached_property
    def hypothesis_count(self) -> int:
        """The number of hypotheses, which is the size of the family of tests."""
        return sum(1 for e in self.effects.values() if self.is_observable(e) for _ in e.main_parameters)

    def is_observable(self, effect: Effect) -> bool:
        """Whether any fitted residual is sensitive to the effect."""
        if effect.part in self.modelled_parts or not any(m.is_sensitive_to(effect) for m in self.train):
            return False
        return effect.balances != PRESSURE_SENSOR_SIDES or any(
            {"p1", "p2"} & m.experiment.raw.keys() for m in self.train
        )

    def sensitive_cost(self, fitted: FittedModel, effect: Effect) -> tuple[float, int]:
        """Return the fitted cost and the number of residuals in the blocks that the effect influences."""
        sensitive = self.sensitive_blocks(effect)[: fitted.train_costs.size]
        return float(fitted.train_costs[sensitive].sum()), int(
            fitted.residual_counts[: fitted.train_costs.size][sensitive].sum()
        )

    def recording_costs(self, fitted: FittedModel, effect: Effect) -> dict[str, list[RecordingCost]]:
        """Return by channel the cost of each recording whose residual model the effect influences.

        Each reading counts once, as held out where it is held out.
        """
        found: dict[str, list[RecordingCost]] = {}
        channels = [(m, channel) for m in self.residual_models for channel in m.channels]
        for (m, channel), cost in zip(channels, fitted.channels, strict=True):
            if m.is_sensitive_to(effect) and cost.residual_count:
                bounds = bounds_of(fitted.model, m) if channel == "force" else Bounds.none()
                found.setdefault(channel, []).append(RecordingCost(*cost, bounds))
        return found

    def exclusive_channel_costs(self, fitted: FittedModel, effect: Effect) -> list[RecordingCost]:
        """Return the cost of the effect's exclusive channels, fitted and held out; of no residual where it has none."""
        return [exclusive_channel_cost(fitted.model, models, effect) for models in (self.train, self.held_out)]

    @cached_property
    def visited(self) -> dict[frozenset[str], VisitedSet]:
        """The cheapest fit of every set of effects that was fitted."""
        return {}

    def visit(self, fitted: FittedModel) -> FittedModel:
        """Note a fitted set of effects, and return it."""
        added = tuple(e.name for e in fitted.model.effects if e.name not in self.base_effects)
        known, cost = self.visited.get(frozenset(added)), fitted.cost / max(fitted.residual_count, 1)
        if known is None or cost < known.cost:
            sizes = relative_effect_sizes(fitted.fit, added, self.train)
            self.visited[frozenset(added)] = VisitedSet(added, log_variances(self.residual_models, fitted), sizes, cost)
        return fitted

    def _refit(self, refits: Sequence[Refit]) -> list[FittedModel]:
        return [self.visit(fitted) for fitted in self.run_refits(self, refits)]

    def sensitive_blocks(self, effect: Effect) -> NDArray[np.bool_]:
        """Return which blocks of a fitted model's costs the effect influences (B,)."""
        return np.repeat([m.is_sensitive_to(effect) for m in self.residual_models], self.block_counts)

    @cached_property
    def residual_models(self) -> tuple[ResidualModel, ...]:
        """The fitted residual models, then the held-out ones."""
        return (*self.train, *self.held_out)

    @cached_property
    def block_counts(self) -> tuple[int, ...]:
        """The number of blocks of each residual model."""
        return tuple(int(block_labels([m])[-1]) + 1 for m in self.residual_models)

    def spline_regression(self, fit: Fit, kind: type[ResidualModel], name: str) -> SplineRegression:
        """Return the regression of a channel on smooth functions of signals, linearised at the first fit that asks for
        it.
        """
        if (kind, name) not in self._spline_regressions:
            self._spline_regressions[kind, name] = SplineRegression(fit, self.train, kind, name)
        return self._spline_regressions[kind, name]

    @cached_property
    def lack_of_fit_cache(self) -> WeakKeyDictionary[FittedModel, LackOfFitByUse]:
        """The lack of fit of fitted models; an entry goes with its model."""
        return WeakKeyDictionary()

    def with_intervals(self, fitted: FittedModel) -> Fit:
        """Return the fit of a model with the variance that model error causes."""
        if fitted not in self._fits_with_intervals:
            self._fits_with_intervals[fitted] = with_intervals(fitted.fit, self.train)
            release_filed()
        return self._fits_with_intervals[fitted]

    def contrast_variances(self, fitted: FittedModel, contrasts: Array) -> tuple[Array, Array]:
        """Return the variances of contrasts (m, k) of a fit's coordinates (m,): by blocks, and with model error."""
        fits = fitted.fit, self.with_intervals(fitted)
        by_blocks, of_intervals = (np.einsum("ij,jk,ik->i", contrasts, f.covariance, contrasts) for f in fits)
        return by_blocks, of_intervals

    def without_derivatives(self, decision: Decision) -> Decision:
        """Return a decision whose candidate keeps its parameters, with their intervals where it passed, and no
        derivatives.
        """
        if (c := decision.candidate) is None:
            return decision
        full = replace(c.full, fit=without_data(self.with_intervals(c.full) if decision.supported else c.full.fit))
        return replace(decision, candidate=replace(c, full=full))

    @cached_property
    def _signatures(self) -> WeakKeyDictionary[FittedModel, dict[str, list[ScoreTest]]]:
        return WeakKeyDictionary()

    @cached_property
    def _fits_with_intervals(self) -> WeakKeyDictionary[FittedModel, Fit]:
        return WeakKeyDictionary()

    @cached_property
    def _spline_regressions(self) -> dict[tuple[type[ResidualModel], str], SplineRegression]:
        return {}

    def fitted_model(self, fit: Fit) -> FittedModel:
        """Return a fit with its costs; its derivatives wait in a file, else those of all candidates fill the memory."""
        found = self._with_costs(fit.with_derivatives(filed(fit.jacobian)))
        release_filed()
        return found

    def _with_costs(self, fit: Fit) -> FittedModel:
        train = fitted_costs(fit, self.train)
        if not self.held_out and not self.folds:
            return FittedModel(fit, train.by_block, np.zeros(0), train.by_block, train.residual_counts, train.channels)
        if self.folds:
            models = leave_one_out_models(fit, self.train, self.folds)
            test = held_out_costs(models, self.train, fit.initial_state_sensitivities)
            return FittedModel(fit, train.by_block, test.by_block, test.by_block, train.residual_counts, test.channels)
        sensitivities = [m.initial_state_sensitivity(fit.model) for m in self.held_out]
        test = held_out_costs([fit.model] * len(sensitivities), self.held_out, sensitivities)
        return FittedModel(
            fit,
            train.by_block,
            test.by_block,
            np.concatenate([train.by_block, test.by_block]),
            np.concatenate([train.residual_counts, test.residual_counts]),
            (*train.channels, *test.channels),
        )

    def has_initial_guess(self, fitted: FittedModel, effect: Effect) -> bool:
        """Whether an effect has a typical size at a fitted model; one in units of Coulomb friction has none without
        friction.
        """
        model = fitted.model
        return bool(
            initial_guesses(effect, rig_quantities(model, [m.experiment for m in self.train]), model.rig.priors)
        )

    def absent_effects(self, model: Model) -> list[Effect]:
        """Return the observable effects that a model lacks."""
        present = {e.name for e in model.effects}
        return [e for e in self.effects.values() if e.name not in present and self.is_observable(e)]

    def ranked_signatures(self, fitted: FittedModel) -> list[ScreenedEffect]:
        """Return the effects that a fitted model lacks with their score tests, the largest predicted gain first."""
        tested = self.signatures_of(fitted, self.absent_effects(fitted.model))
        return sorted(((e, tests) for e, tests in tested if tests[0].gain > 0.0), key=lambda one: -one[1][0].gain)

    def signatures_of(self, fitted: FittedModel, effects: Sequence[Effect]) -> list[ScreenedEffect]:
        """Return the score tests of effects at a fitted model, best first, without effects that have none.

        The last round of a search asks for those of the model that it ends with, as does what is detectable there.
        """
        known = self._signatures.setdefault(fitted, {})
        for i, effect in enumerate(effects):
            if effect.name not in known:
                self.progress(screening_progress(effect.name, len(effects) - i - 1))
                known[effect.name] = score_tests(effect, fitted.fit, self.train)
        return [(e, known[e.name]) for e in effects if known[e.name]]

    def run_refit(self, task: Refit) -> FittedModel:
        """Do one refit."""
        return self.fitted_model(self._fit_of(task))

    def _fit_of(self, task: Refit) -> Fit:
        if task.kind == "add":
            self.progress(fitting_progress(task.effect.name))
            return fit_with_effect(task.base.fit, self.train, task.effect, stopping=RANKING_EFFORT, ranked=task.ranked)
        if task.kind == "drop":
            return fit_without(task.base.fit, self.train, task.effect, stopping=RANKING_EFFORT)
        return refit(task.base.fit, self.train)

    def refit_with(
        self, fitted: FittedModel, effects: Sequence[Effect], ranked: Sequence[Sequence[ScoreTest]] = ()
    ) -> list[Candidate]:
        """Refit with each effect (from the score tests ``ranked``), and compare on fitted and held-out data."""
        refits = [Refit("add", fitted, e, tuple(s) if s else None) for e, s in zip_longest(effects, ranked)]
        refitted = self._refit(refits)
        return [self.candidate(fitted, full, effect) for full, effect in zip(refitted, effects, strict=True)]

    def refit_to_convergence(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """Refit candidates until convergence."""
        refitted = self._refit([Refit("converge", c.full, c.effect) for c in candidates])
        return [self.candidate(c.reduced, full, c.effect) for full, c in zip(refitted, candidates, strict=True)]

    def refit_without(self, fitted: FittedModel, effects: Sequence[Effect]) -> list[FittedModel]:
        """Refit without each of the effects, one at a time; until convergence where the cost hardly rises."""
        found = self._refit([Refit("drop", fitted, effect) for effect in effects])
        near = [i for i, one in enumerate(found) if one.cost < CONVERGED_COST_RATIO * fitted.cost]
        converged = self._refit([Refit("converge", found[i], effects[i]) for i in near])
        return [dict(zip(near, converged, strict=True)).get(i, one) for i, one in enumerate(found)]

    def candidate(self, reduced: FittedModel, full: FittedModel, effect: Effect) -> Candidate:
        """Return the candidate of the step from the reduced to the full model."""
        replaced = replaced_base_parameters(full.fit, effect, self.train)
        found = Candidate(effect, reduced, full, self._p_value(reduced, full, effect), replaced)
        release_filed()
        return found

    def _p_value(self, reduced: FittedModel, full: FittedModel, effect: Effect) -> float:
        """Return the p value of an effect from its parameters, or from its gain where it has no null.

        Parameters that only their combination determines are within their errors of their nulls, however much they
        explain. Held-out recordings are a second test; the smaller of both p values counts twice (Bonferroni).
        """
        p_value = wald_p_value(full.fit, effect, self.train)
        if np.isnan(p_value):
            return gain_p_value(reduced.train_costs, full.train_costs)
        if not self.held_out:
            return p_value
        return min(2.0 * min(p_value, gain_p_value(reduced.test_costs, full.test_costs)), 1.0)


def lack_of_fit(data: DiagnosisData, fitted: FittedModel) -> LackOfFitByUse:
    """Return the lack of fit of a fitted model on fitted and on held-out data."""
    if fitted not in data.lack_of_fit_cache:
        data.lack_of_fit_cache[fitted] = (
            lack_of_fit_by_channel(fitted.model, data.train),
            held_out_lack_of_fit(fitted.fit, data.held_out),
        )
    return data.lack_of_fit_cache[fitted]
