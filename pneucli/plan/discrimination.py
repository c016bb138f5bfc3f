"""The manoeuvre in which two fitted models differ most, for the sentence of a diagnosis.

References:
    Hunter, W. G. and Reiner, A. M., Technometrics 7 (1965) 307.

"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.plan.bench import Bench, recorded_benches
from pneucli.plan.limits import Limits, limits_of, violations
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.manoeuvres import candidate_manoeuvres
from pneucli.plan.simulation import simulate_manoeuvre
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model

MIN_SEPARATION = 3.0  # times the noise
COMPARED = ("x", "v", "a", "p1", "p2", "force", "temperature", "flow")  # readings that may differ


@dataclass(frozen=True)
class Discrimination:
    """The separation of two models in a manoeuvre: the rms of their difference in the channel with the largest one."""

    manoeuvre: Manoeuvre
    channel: str
    times_noise: float


def most_discriminating_manoeuvre(one: Model, other: Model, experiments: Sequence[Experiment]) -> Discrimination | None:
    """Return the manoeuvre that separates two fitted models most.

    The models are not fitted again, because both were fitted to all recordings.

    Args:
        one: The first model.
        other: The second model.
        experiments: The recordings, whose benches carry the manoeuvre out.

    Returns:
        The manoeuvre; None where no difference exceeds MIN_SEPARATION within the limits of the rig.
    """
    benches = recorded_benches(experiments)
    limits = limits_of(one.rig, benches)
    found = (d for bench in benches for d in _separations(one, other, bench, limits))
    best = max(found, key=lambda d: d.times_noise, default=None)
    return best if best is not None and best.times_noise > MIN_SEPARATION else None


def _separations(one: Model, other: Model, bench: Bench, limits: Limits) -> Iterator[Discrimination]:
    channels = [c for c in COMPARED if c in bench.noise and bench.noise[c].rms > 0.0]
    for manoeuvre in candidate_manoeuvres(bench, limits):
        first, second = (simulate_manoeuvre(manoeuvre, model) for model in (one, other))
        if violations(first, limits, one.rig) or violations(second, limits, one.rig):
            continue
        for channel in channels:
            difference = first.readings[channel] - second.readings[channel]
            times_noise = float(np.sqrt(np.mean(difference**2))) / bench.noise[channel].rms
            if np.isfinite(times_noise):
                yield Discrimination(manoeuvre, channel, times_noise)
