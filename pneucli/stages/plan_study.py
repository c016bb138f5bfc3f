"""What a plan needs of a diagnosed pipeline: the best model, its rivals, its benches, and the limits of the rig."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from pneucli.errors import InputError, did_you_mean
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.effects import select_effects
from pneucli.pipeline.context import Context
from pneucli.plan.bench import Bench, recorded_benches
from pneucli.plan.deviation import ExpectedDeviation
from pneucli.plan.evaluation import Comparison
from pneucli.plan.information import deviations_of
from pneucli.plan.limits import Limits, limits_of
from pneucli.plan.rivals import Rival, lagged_models, rivals_of_diagnosis
from pneucli.plan.safety import Safety, models_to_check
from pneucli.simulate.model import Model
from pneucli.stages.pipeline_data import PipelineData


@dataclass(frozen=True)
class PlanStudy:
    """A diagnosed pipeline, for its next experiment."""

    pipeline: PipelineData

    @property
    def context(self) -> Context:
        """The run of the stage."""
        return self.pipeline.context

    @cached_property
    def diagnosis(self) -> dict[str, Any]:
        """The answer of the last diagnosis."""
        return dict(self.context.answers["diagnose"])

    @cached_property
    def train(self) -> list[ResidualModel]:
        """The residual models of the fitted recordings."""
        found = self.pipeline.residual_models("train")
        if not found:
            raise InputError(
                f"{self.context.path}, key recordings",
                "no recording over time to plan from",
                "recordings, or --first",
                f"pneucli plan {self.context.path} --first",
                code="E061",
            )
        return found

    @cached_property
    def best(self) -> Fit:
        """The fit of the model with the effects of the pipeline file and those that the diagnosis names."""
        given = self.pipeline.effects
        named = [n for n in self.diagnosis["missing"] if n not in {e.name for e in given}]
        added = select_effects(named, self.pipeline.available_effects, f"{self.context.path}, key model.effects")
        guess = guess_base_model([one.experiment for one in self.train], self.pipeline.rig, self.pipeline.valve)
        return with_intervals(fit_model(guess, self.train, (*given, *added)), self.train)

    @cached_property
    def rivals(self) -> list[Rival]:
        """The best model and its rivals; those with the effects of ``--effects``, where it is given."""
        wanted: Sequence[str] = self.context.options.get("effects", [])
        for name in wanted:
            if name not in self.pipeline.available_effects:
                mend = did_you_mean(name, self.pipeline.available_effects)
                raise InputError("--effects", f'no effect "{name}"', "effects of the catalogue", mend, code="E030")
        return rivals_of_diagnosis(self.best, self.train, self.diagnosis, self.pipeline.available_effects, wanted)

    @cached_property
    def benches(self) -> list[Bench]:
        """The benches of the recordings."""
        return recorded_benches([one.experiment for one in self.train])

    @cached_property
    def limits(self) -> Limits:
        """The limits of the rig."""
        return limits_of(self.pipeline.rig, self.benches, self.context.config.plan.model_dump())

    @cached_property
    def safety(self) -> Safety:
        """The check of a manoeuvre in every rival."""
        return Safety(self.pipeline.rig, self.limits, models_to_check(self.best, self.rivals))

    @cached_property
    def lags(self) -> list[Model]:
        """The best model with each lag that it lacks and the recordings can show, at its typical size."""
        return lagged_models(self.best.model, self.pipeline.available_effects.values(), self.train)

    @cached_property
    def deviations(self) -> dict[tuple[str, str], ExpectedDeviation]:
        """The expected deviation of the best model by subsystem and channel."""
        return deviations_of(self.best, self.train, self.lags)

    def comparison(self, others: Sequence[Model]) -> Comparison:
        """Return the comparison of planned recordings with some models."""
        compare, best = self.context.config.compare, self.best
        horizon, low_pass = compare.horizon, compare.low_pass
        return Comparison(best.model, others, best.free, self.deviations, horizon, low_pass, self.lags)

    def positions_of(self, parameters: Sequence[str]) -> list[int]:
        """Return the positions of named parameters in the fit; raises InputError where one is not fitted."""
        names = [f.name for f in self.best.free]
        for name in parameters:
            if name not in names:
                raise InputError(
                    "--parameters",
                    f'no fitted parameter "{name}"',
                    ", ".join(names),
                    did_you_mean(name, names),
                    code="E031",
                )
        return [names.index(name) for name in parameters]


def progress_within(context: Context, begin: float, end: float) -> Callable[[str, float], None]:
    """Return a report of progress between two shares of the stage's work."""
    return lambda text, share: context.progress(text, begin + (end - begin) * share)
