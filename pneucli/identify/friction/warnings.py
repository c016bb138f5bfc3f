"""Warnings about identified friction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pneucli.identify.friction.friction_model import TITLES, FrictionModel, ModelName
from pneucli.identify.friction.imposed_motion import KineticFriction
from pneucli.identify.friction.regression import FrictionFit
from pneucli.identify.friction.samples import MovingSamples
from pneucli.messages.findings import Finding

MAX_RESIDUAL_TO_NOISE = 1.5  # times the sensors' noise: a larger residual of model A is not noise
MAX_STRIBECK_VELOCITY_RATIO = 0.25  # of the highest speed: beyond it the fall of friction is not fully observed


def missing_model_warnings(models: Sequence[FrictionModel], samples: MovingSamples) -> Iterator[Finding]:
    """Yield a warning where the samples of a branch are too few for some of the models A to F.

    Args:
        models: The identified models.
        samples: The moving samples.

    Yields:
        The names of the missing models and the number of samples of each branch.

    """
    missing = [name for name in TITLES if name not in {m.name for m in models}]
    if missing:
        counts = {
            "accelerating": int(np.count_nonzero(samples.branch > 0)),
            "slowing": int(np.count_nonzero(samples.branch < 0)),
        }
        yield Finding("models-missing", {"models": ", ".join(missing), **counts})


def model_a_warnings(
    fit: FrictionFit, samples: MovingSamples, unmodelled: Mapping[ModelName, tuple[str, ...]]
) -> Iterator[Finding]:
    """Yield warnings about the fit of model A.

    Args:
        fit: The fit of model A.
        samples: The moving samples.
        unmodelled: For each model the effects of the pipeline's model that it cannot represent.

    Yields:
        A significant constant force, a misfit, and parameters that are uncertain.

    """
    values = fit.values()
    if "offset" in values and values["offset"].excludes(0.0):
        yield Finding("force-offset", {"force": values["offset"].value})
    if fit.deviation > MAX_RESIDUAL_TO_NOISE:
        better = [name for name in unmodelled if set(unmodelled[name]) < set(unmodelled["A"])]
        yield Finding("misfit", {"ratio": fit.deviation, "unmodelled": unmodelled["A"], "better": better})
    if values["coulomb"].low <= 0:
        yield Finding("dry-friction-not-significant")
    max_speed = np.abs(samples.v).max(initial=0.0)
    if "velocity" in values and samples.v.size and values["velocity"].value > MAX_STRIBECK_VELOCITY_RATIO * max_speed:
        yield Finding("static-friction-uncertain")


def level_warnings(levels: Sequence[KineticFriction]) -> Iterator[Finding]:
    """Yield a warning where kinetic friction differs between recordings by more than both intervals.

    Args:
        levels: Kinetic friction of the recordings.

    Yields:
        The smallest and the largest friction in N.

    """
    if levels and max(k.friction.low for k in levels) > min(k.friction.high for k in levels):
        values = [k.friction.value for k in levels]
        yield Finding("levels-differ", {"lowest": min(values), "highest": max(values)})
