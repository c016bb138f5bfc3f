"""Refits that need nothing of each other: one after another here, or elsewhere at once, with the same results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import zip_longest
from typing import Literal
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.adequacy import LackOfFit, held_out_lack_of_fit, lack_of_fit_by_channel
from pneucli.diagnose.cross_validation import leave_one_out_models
from pneucli.diagnose.evidence import ScoreGain, score_gain, wald_p_value
from pneucli.diagnose.free_run_adequacy import MAX_MEDIAN_RATIO
from pneucli.diagnose.score import fitted_costs, held_out_costs
from pneucli.diagnose.smooth_term import SplineRegression
from pneucli.experiments import Part
from pneucli.identify.estimation.blocks import block_labels
from pneucli.identify.estimation.fit import Fit, StoppingRule
from pneucli.identify.estimation.model_fit import fit_with_effect, fit_without, refit
from pneucli.identify.estimation.score_test import ScoreTest, initial_guesses, score_tests
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities


@dataclass(frozen=True)
class Refit:
    """A fit from ``base``: with ``effect`` more (from signatures ``ranked``, where known), without, or to the end."""

    kind: Literal["with", "without", "to the end"]
    base: FittedModel
    effect: Effect
    ranked: tuple[ScoreTest, ...] | None = None


RunRefits = Callable[["DiagnosisData", Sequence[Refit]], "list[FittedModel]"]


def run_locally(bench: DiagnosisData, refits: Sequence[Refit]) -> list[FittedModel]:
    """Return the states that refits end in, done one after another."""
    return [bench.run_refit(one) for one in refits]


Array = NDArray[np.float64]


RANKING_EFFORT = StoppingRule(12, 5e-3)  # of a first fit, which only ranks: about what is MATERIAL
FREE_RUN_TOLERANCE = (
    1.05  # of an error that rests on few stick-slips, whose start noise shifts; a fall by as much is chance too
)
PRESSURE_SENSOR_SIDES = frozenset({"pressure sensor"})  # faults of it cannot show where no pressure is recorded
ScreenedEffect = tuple[Effect, list[ScoreTest]]
ErrorsByUse = Mapping[str, float | None]
LackOfFitByUse = tuple[list[LackOfFit], list[LackOfFit]]


@dataclass(frozen=True)
class DiagnosisData:
    """The data of a diagnosis: views to fit, views held out, and the effects that may be missing.

    Where none is held out, ``folds`` has for each fitted view the turn in which it is (:mod:`pneucli.diagnose.cross_validation`).
    ``modelled_parts`` are parts whose effects the model's valve shows already; ``base_effects`` names the effects that the model had
    before; ``free_run_errors`` is the error that the user sees, by use. ``implausible``: a check of the recordings failed.
    ``run_refits`` does several that need nothing of each other.
    """

    train: Sequence[ResidualModel]
    held_out: Sequence[ResidualModel]
    effects: Mapping[str, Effect]
    modelled_parts: frozenset[Part] = frozenset()
    base_effects: tuple[str, ...] = ()
    progress: Callable[[str], None] = field(default=lambda _: None)
    folds: tuple[int, ...] = ()
    free_run_errors: Callable[[Model], ErrorsByUse] | None = None
    implausible: bool = False
    run_refits: RunRefits = run_locally

    @property
    def has_held_out_data(self) -> bool:
        """Whether there are data that a fit has not seen."""
        return bool(self.held_out or self.folds)

    @cached_property
    def hypothesis_count(self) -> int:
        """How many starts are screened in all: the size of the family of tests."""
        return sum(1 for e in self.effects.values() if self.is_observable(e) for _ in e.main_parameters)

    def is_observable(self, effect: Effect) -> bool:
        """Whether the effect acts in any view that is fitted."""
        if effect.part in self.modelled_parts or not any(view.is_sensitive_to(effect) for view in self.train):
            return False
        return effect.balances != PRESSURE_SENSOR_SIDES or any(
            {"p1", "p2"} & view.experiment.raw.keys() for view in self.train
        )

    def sensitive_cost(self, state: FittedModel, effect: Effect) -> tuple[float, int]:
        """Return the fitted cost of what the effect acts in, and how many residuals are behind it.

        What it cannot act in says nothing of it, however much is left there.
        """
        felt = self.sensitive_blocks(effect)[: state.train_costs.size]
        return float(state.train_costs[felt].sum()), int(state.residual_counts[: state.train_costs.size][felt].sum())

    def sensitive_costs(self, state: FittedModel, effect: Effect) -> list[tuple[float, float]]:
        """Return the cost of what the effect acts in and how many residuals are behind it: fitted, and held out apart.

        Held out by turns it is one part.
        """
        felt, edge = self.sensitive_blocks(effect), state.train_costs.size
        parts = (slice(0, edge), slice(edge, state.costs.size))
        sums = [(float(state.costs[p][felt[p]].sum()), float(state.residual_counts[p][felt[p]].sum())) for p in parts]
        return [(cost, count) for cost, count in sums if count]

    def exclusive_channel_costs(self, state: FittedModel, effect: Effect) -> list[tuple[float, float]]:
        """Return the same of the readings that show such an effect alone: nothing of nothing where there are none."""
        return [_exclusive_channel_cost(state.model, views, effect) for views in (self.train, self.held_out)]

    def sensitive_blocks(self, effect: Effect) -> NDArray[np.bool_]:
        """Return in which blocks of a state's costs the effect acts (B,)."""
        return np.repeat([view.is_sensitive_to(effect) for view in self.views], self.block_counts)

    @cached_property
    def views(self) -> tuple[ResidualModel, ...]:
        """The fitted views, then those held out."""
        return (*self.train, *self.held_out)

    @cached_property
    def block_counts(self) -> tuple[int, ...]:
        """How many blocks of time each of these views has."""
        return tuple(int(block_labels([view])[-1]) + 1 for view in self.views)

    def spline_regression(self, found: Fit, kind: type[ResidualModel], name: str) -> SplineRegression:
        """Return what laws of signals make of a channel, as some fit of this bench has its flows."""
        if (kind, name) not in self._spline_regressions:
            self._spline_regressions[kind, name] = SplineRegression(found, self.train, kind, name)
        return self._spline_regressions[kind, name]

    @cached_property
    def lack_of_fit_cache(self) -> WeakKeyDictionary[FittedModel, LackOfFitByUse]:
        """What states leave over, as far as it was asked for; a state that nobody needs any more is let go."""
        return WeakKeyDictionary()

    @cached_property
    def _spline_regressions(self) -> dict[tuple[type[ResidualModel], str], SplineRegression]:
        return {}

    def fitted_model(self, found: Fit) -> FittedModel:
        """Return a fit with its costs."""
        train, counts = fitted_costs(found, self.train)
        if not self.held_out and not self.folds:
            return FittedModel(found, train, np.zeros(0), train, counts)
        if self.folds:
            test, _ = held_out_costs(
                leave_one_out_models(found, self.train, self.folds), self.train, found.initial_state_sensitivities
            )
            return FittedModel(found, train, test, test, counts)
        starts = [view.initial_state_sensitivity(found.model) for view in self.held_out]
        test, more = held_out_costs([found.model] * len(starts), self.held_out, starts)
        return FittedModel(found, train, test, np.concatenate([train, test]), np.concatenate([counts, more]))

    def has_initial_guess(self, state: FittedModel, effect: Effect) -> bool:
        """Whether an effect has a typical size at a state: one that is counted in dry friction has none without."""
        model = state.model
        return bool(
            initial_guesses(effect, rig_quantities(model, [v.experiment for v in self.train]), model.rig.priors)
        )

    def absent_effects(self, state: FittedModel) -> list[Effect]:
        """Return the effects that a state lacks and that can show."""
        return [e for e in self.effects.values() if self.is_observable(e) and e.name not in state.effect_names]

    def ranked_signatures(self, state: FittedModel) -> list[ScreenedEffect]:
        """Return the effects that the state lacks with their signatures, by what the best one promises."""
        ranked = [
            (e, found) for e, found in self.signatures_of(state, self.absent_effects(state)) if found[0].gain > 0.0
        ]
        return sorted(ranked, key=lambda pair: -pair[1][0].gain)

    def signatures_of(self, state: FittedModel, effects: Sequence[Effect]) -> list[ScreenedEffect]:
        """Return the signatures of effects at a state, best first; those without any are left out."""
        out = []
        for i, effect in enumerate(effects):
            self.progress(f"screening {effect.name}, {len(effects) - i - 1} left")
            found = score_tests(effect, state.fit, self.train)
            if found:
                out.append((effect, found))
        return out

    def run_refit(self, one: Refit) -> FittedModel:
        """Do one refit."""
        if one.kind == "with":
            self.progress(f"fitting {one.effect.name}")
            return self.fitted_model(
                fit_with_effect(one.base.fit, self.train, one.effect, stopping=RANKING_EFFORT, ranked=one.ranked)
            )
        if one.kind == "without":
            return self.fitted_model(fit_without(one.base.fit, self.train, one.effect))
        return self.fitted_model(refit(one.base.fit, self.train))

    def refit_with(
        self, state: FittedModel, effects: Sequence[Effect], ranked: Sequence[Sequence[ScoreTest]] = ()
    ) -> list[Candidate]:
        """Refit with each effect (from signatures ``ranked``), and hold it against data that the fit has not seen."""
        refits = [Refit("with", state, e, tuple(s) if s else None) for e, s in zip_longest(effects, ranked)]
        ended = self.run_refits(self, refits)
        return [self.candidate(state, after, effect) for after, effect in zip(ended, effects, strict=True)]

    def refit_to_convergence(self, trials: Sequence[Candidate]) -> list[Candidate]:
        """Fit trials to the end."""
        ended = self.run_refits(self, [Refit("to the end", t.full, t.effect) for t in trials])
        return [self.candidate(t.reduced, after, t.effect) for after, t in zip(ended, trials, strict=True)]

    def refit_without(self, state: FittedModel, effects: Sequence[Effect]) -> list[FittedModel]:
        """Refit without each of the effects, one at a time."""
        return self.run_refits(self, [Refit("without", state, effect) for effect in effects])

    def free_run_error_rises(self, before: FittedModel, after: FittedModel) -> bool:
        """Whether the error that the user sees rises: for all uses, or in their mean by more than chance may."""
        ratios = self._free_run_ratios(before, after)
        return bool(ratios) and (min(ratios) > 1.0 or float(np.prod(ratios)) > FREE_RUN_TOLERANCE ** len(ratios))

    def free_run_error_falls(self, before: FittedModel, after: FittedModel) -> bool:
        """Whether the error that the user sees falls in the mean of all uses."""
        return self.free_run_errors is None or float(np.prod(self._free_run_ratios(before, after))) < 1.0

    def free_run_error_falls_clearly(self, before: FittedModel, after: FittedModel) -> bool:
        """Whether it falls in that mean by more than chance may."""
        ratios = self._free_run_ratios(before, after)
        return not ratios or float(np.prod(ratios)) < FREE_RUN_TOLERANCE ** -len(ratios)

    def free_run_error_diverges(self, before: FittedModel, after: FittedModel) -> bool:
        """Whether it rises for all uses by as much as tells a model that does not replay."""
        ratios = self._free_run_ratios(before, after)
        return bool(ratios) and min(ratios) > MAX_MEDIAN_RATIO

    def _free_run_ratios(self, before: FittedModel, after: FittedModel) -> list[float]:
        """Return the error that the user sees after over that before, for each use that has one."""
        if self.free_run_errors is None:
            return []
        old, new = self.free_run_errors(before.model), self.free_run_errors(after.model)
        return [b / a for a, b in zip(old.values(), new.values(), strict=True) if a and b is not None]

    def candidate(self, before: FittedModel, after: FittedModel, effect: Effect) -> Candidate:
        """Return what the step from one state to the other is worth."""
        train, test = score_gain(before.train_costs, after.train_costs), score_gain(before.test_costs, after.test_costs)
        return Candidate(
            effect, before, after, train, test, self._p_value(wald_p_value(after.fit, effect, self.train), train, test)
        )

    def _p_value(self, p_value: float, train: ScoreGain, test: ScoreGain) -> float:
        """Return the chance of an effect, by its parameters (NaN where it has no null) or by what it gains.

        Parameters that are known only together stand within their errors of their nulls, however much they explain:
        recordings held out apart are a second test, and of two the better one counts twice (Bonferroni).
        """
        if np.isnan(p_value):
            return train.p_value
        return min(2.0 * min(p_value, test.p_value), 1.0) if self.held_out else p_value


def _exclusive_channel_cost(model: Model, views: Sequence[ResidualModel], effect: Effect) -> tuple[float, float]:
    """Return the squares, in units of the noise, of readings that show such an effect alone, and their number."""
    left = [view.residual(model)[c] / view.noise[c] for view in views for c in view.exclusive_channels(effect)]
    return float(sum(r @ r for r in left)), float(sum(np.count_nonzero(r) for r in left))


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A fitted model and what it leaves over, as costs by block: ``train_costs`` as fitted, ``test_costs`` held out.

    ``costs`` counts each reading once, held out where it is; ``residual_counts`` are the residuals behind each of them, zeros of
    what does not count left out.
    """

    fit: Fit
    train_costs: Array
    test_costs: Array
    costs: Array
    residual_counts: Array

    @property
    def residual_count(self) -> int:
        """How many residuals are behind the costs: what noise alone would cost."""
        return int(self.residual_counts.sum())

    @property
    def model(self) -> Model:
        """The fitted model."""
        return self.fit.model

    @property
    def effect_names(self) -> list[str]:
        """The effects that the model has."""
        return [e.name for e in self.fit.model.effects]

    @property
    def cost(self) -> float:
        """The sum of all costs."""
        return float(self.costs.sum())


def lack_of_fit(bench: DiagnosisData, state: FittedModel) -> LackOfFitByUse:
    """Return what a state leaves over in the fitted and in the held-out views."""
    if state not in bench.lack_of_fit_cache:
        bench.lack_of_fit_cache[state] = (
            lack_of_fit_by_channel(state.model, bench.train),
            held_out_lack_of_fit(state.fit, bench.held_out),
        )
    return bench.lack_of_fit_cache[state]


@dataclass(frozen=True)
class Candidate:
    """The step from ``reduced`` to ``full`` by one effect.

    With its gains on trained and held-out data, and ``p_value`` of its parameters, not adjusted.
    """

    effect: Effect
    reduced: FittedModel
    full: FittedModel
    train_gain: ScoreGain
    test_gain: ScoreGain
    p_value: float
