"""The error that the user sees: that of ``compare``, for any model of the search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pneucli.compare import ChannelResult, compare, overall_error
from pneucli.compare.expected_error import expected_rms_of_all
from pneucli.diagnose.data import ErrorsByUse
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model


@dataclass(frozen=True)
class FreeRunErrors:
    """The errors of models over what each would show itself were it correct, as ``compare`` has them.

    The noise is drawn and simulated, which takes as long as a fit: what was asked for once is kept.
    """

    experiments: Sequence[Experiment]
    _cache: list[tuple[Model, list[ChannelResult]]] = field(default_factory=list)

    def __call__(self, model: Model) -> ErrorsByUse:
        """Return the model's errors {"train": ..., "test": ...}; None where no recording has that use."""
        results = self.channels(model)
        return {use: overall_error(results, use) for use in ("train", "test")}

    def channels(self, model: Model) -> list[ChannelResult]:
        """Return the model's error in every channel of every recording."""
        for seen, known in self._cache:
            if seen is model:
                return known
        noise = expected_rms_of_all(model, self.experiments)
        pairs = zip(self.experiments, noise, strict=True)
        results = [result for experiment, expected in pairs for result in compare(model, experiment, expected).results]
        self._cache.append((model, results))
        return results


def held_out_error(errors: ErrorsByUse) -> float | None:
    """Return the error that speaks for itself: that of held-out recordings, where there are any."""
    return errors["train"] if errors["test"] is None else errors["test"]


def remaining_error_share(first: ErrorsByUse, last: ErrorsByUse) -> float | None:
    """Return the part of the squared error beyond noise that remains; None where there is no error."""
    before, after = held_out_error(first), held_out_error(last)
    if before is None or after is None:
        return None
    if before <= 1.0:
        return 0.0
    return min(max((after**2 - 1.0) / (before**2 - 1.0), 0.0), 1.0)


def removed_error_share(first: ErrorsByUse, last: ErrorsByUse) -> float | None:
    """Return the part of the squared error beyond noise that goes; None where there is no such error."""
    before, left = held_out_error(first), remaining_error_share(first, last)
    return None if before is None or before <= 1.0 or left is None else 1.0 - left
