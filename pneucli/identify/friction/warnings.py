"""Warnings about identified friction, and the effects of the pipeline that a model of friction cannot represent."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pneucli.identify.friction.friction_model import TITLES, FrictionModel, ModelName
from pneucli.identify.friction.imposed_motion import KineticFriction
from pneucli.identify.friction.kinematics import Motion
from pneucli.identify.friction.regression import FrictionFit
from pneucli.identify.friction.samples import MovingSamples
from pneucli.messages.findings import Finding
from pneucli.physics.declaration import Effect
from pneucli.physics.ports import PORTS
from pneucli.simulate.model import Model

MAX_STATES = 100  # of each recording, at which a factor is evaluated
BY_BRANCH, BY_DIRECTION, NO_MODEL = set("DEF"), set("CF"), set[str]()
# the models that can represent an effect at each port of friction; D has no Stribeck rise while slowing
MODELS_BY_PORT = {
    "dry_rise": set("ABCF"),
    "slowing": BY_BRANCH,
    "slowing_viscous": BY_BRANCH,
    "viscous_factor": BY_DIRECTION,
}
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


def unmodelled_effects(model: Model, motions: Sequence[Motion]) -> dict[ModelName, tuple[str, ...]]:
    """List for each of the models A to F the effects on friction that it cannot represent in these recordings.

    Args:
        model: The pipeline's model.
        motions: The motions of the training recordings.

    Returns:
        Names of effects by model.

    """
    return {name: tuple(e.name for e in model.effects if not _represents(name, e, model, motions)) for name in TITLES}


def _represents(name: ModelName, effect: Effect, model: Model, motions: Sequence[Motion]) -> bool:
    ports = [port for port in effect.ports if PORTS[port].balance == "friction"]
    return all(name in _representing_models(port, effect, model, motions) for port in ports)


def _representing_models(port: str, effect: Effect, model: Model, motions: Sequence[Motion]) -> set[str]:
    if port == "dry_rise" and any("slowing" in e.ports for e in model.effects):  # then it is one branch's, as in D
        return MODELS_BY_PORT[port] | BY_BRANCH
    if port == "dry_factor" and _by_direction_alone(effect, model, motions):
        return BY_DIRECTION
    return MODELS_BY_PORT.get(port, NO_MODEL)


def _by_direction_alone(effect: Effect, model: Model, motions: Sequence[Motion]) -> bool:
    """Return whether the factor on dry friction is one number for each direction wherever the piston moved."""
    ambient, values = model.rig.ambient_pressure, model.effect_parameters(effect)
    for direction in (1.0, -1.0):
        factors = [
            effect.ports["dry_factor"](direction, *state, ambient, *values)
            for motion in motions
            for state in _sampled_states(motion, ambient)
        ]
        if factors and np.ptp(np.array(factors, dtype=np.float64)) > 0.0:
            return False
    return True


def _sampled_states(motion: Motion, ambient: float) -> list[tuple[float, float, float]]:
    """Return some positions and pressures p1, p2 of the moving piston."""
    indices = np.flatnonzero(motion.moving)
    indices = indices[:: max(1, indices.size // MAX_STATES)]
    p1, p2 = (
        motion.recording[n][indices] if n in motion.recording else np.full(indices.size, ambient) for n in ("p1", "p2")
    )
    return [(float(x), float(a), float(b)) for x, a, b in zip(motion.x[indices], p1, p2, strict=True)]
