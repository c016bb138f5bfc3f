"""Warnings about identified friction, as data; :mod:`pneucli.messages.friction` words them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from pneucli.identify.friction.friction_model import TITLES, FrictionModel, ModelName
from pneucli.identify.friction.imposed_motion import KineticFriction
from pneucli.identify.friction.regression import FrictionFit
from pneucli.identify.friction.samples import MovingSamples

Kind = Literal[
    "one-direction",
    "mass-not-identifiable",
    "models-missing",
    "force-offset",
    "misfit",
    "dry-friction-not-significant",
    "static-friction-uncertain",
    "levels-differ",
]

MAX_RESIDUAL_TO_NOISE = 1.5  # times the sensors' noise: a larger residual of model A is not noise
MAX_STRIBECK_VELOCITY_RATIO = 0.25  # of the highest speed: beyond it the fall of friction is not fully observed


@dataclass(frozen=True)
class FrictionWarning:
    """One warning: its ``kind``, and the ``values`` (SI) and names that its sentence needs."""

    kind: Kind
    values: Mapping[str, Any] = field(default_factory=dict)


def missing_model_warnings(models: Sequence[FrictionModel], samples: MovingSamples) -> Iterator[FrictionWarning]:
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
        yield FrictionWarning("models-missing", {"models": missing, "samples": counts})


def model_a_warnings(
    fit: FrictionFit, samples: MovingSamples, unmodelled: Mapping[ModelName, tuple[str, ...]]
) -> Iterator[FrictionWarning]:
    """Yield warnings about the fit of model A.

    Args:
        fit: The fit of model A.
        samples: The moving samples.
        unmodelled: For each model the effects of the pipeline's model that it cannot represent.

    Yields:
        A significant constant force, a misfit, and parameters that are uncertain.

    """
    values = fit.values()
    if "offset" in values and (values["offset"].ci_low > 0 or values["offset"].ci_high < 0):
        yield FrictionWarning("force-offset", {"force": values["offset"].value})
    if fit.deviation > MAX_RESIDUAL_TO_NOISE:
        better = [name for name in unmodelled if set(unmodelled[name]) < set(unmodelled["A"])]
        yield FrictionWarning("misfit", {"ratio": fit.deviation, "unmodelled": unmodelled["A"], "better": better})
    if values["coulomb"].ci_low <= 0:
        yield FrictionWarning("dry-friction-not-significant")
    max_speed = np.abs(samples.v).max(initial=0.0)
    if "velocity" in values and samples.v.size and values["velocity"].value > MAX_STRIBECK_VELOCITY_RATIO * max_speed:
        yield FrictionWarning("static-friction-uncertain")


def level_warnings(levels: Sequence[KineticFriction]) -> Iterator[FrictionWarning]:
    """Yield a warning where kinetic friction differs between recordings by more than both intervals.

    Args:
        levels: Kinetic friction of the recordings.

    Yields:
        The smallest and the largest friction in N.

    """
    if levels and max(k.friction.ci_low for k in levels) > min(k.friction.ci_high for k in levels):
        values = [k.friction.value for k in levels]
        yield FrictionWarning("levels-differ", {"lowest": min(values), "highest": max(values)})
