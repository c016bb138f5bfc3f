"""The error that the user sees: that of ``compare``, for any model of the search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pneucli.compare import compare, overall_error
from pneucli.compare.expected import expected_of_all
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model


@dataclass(frozen=True)
class Errors:
    """Root mean square of the ratios to noise, by use; the noise is that of one model, so that rungs compare."""

    experiments: Sequence[Experiment]
    noise: Sequence[dict[str, float]]

    @classmethod
    def seen_by(cls, model: Model, experiments: Sequence[Experiment]) -> Errors:
        """Return errors in units of what ``model`` would show were it correct."""
        return cls(experiments, expected_of_all(model, experiments))

    def of(self, model: Model) -> dict[str, float | None]:
        """Return the model's errors {"train": ..., "test": ...}; None where no recording has that use."""
        results = [
            result
            for experiment, noise in zip(self.experiments, self.noise, strict=True)
            for result in compare(model, experiment, noise).results
        ]
        return {use: overall_error(results, use) for use in ("train", "test")}


def shown_error(model: Model, experiments: Sequence[Experiment]) -> dict[str, float | None]:
    """Return a model's errors over what it would show itself were it correct, as ``compare`` does."""
    return Errors.seen_by(model, experiments).of(model)
