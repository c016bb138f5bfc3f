"""Effects on friction in the pipeline's model that the models A to F cannot represent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.friction.friction_model import TITLES, ModelName
from pneucli.identify.friction.kinematics import Motion
from pneucli.physics.declaration import Effect
from pneucli.physics.ports import PORTS
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

MAX_STATES = 100  # of each recording, at which a factor is evaluated
BY_BRANCH, BY_DIRECTION, NO_MODEL = set("DEF"), set("CF"), set[str]()
# the models that can represent an effect at each port of friction; D has no Stribeck rise while slowing
MODELS_BY_PORT = {
    "dry_rise": set("ABCF"),
    "slowing": BY_BRANCH,
    "slowing_viscous": BY_BRANCH,
    "viscous_factor": BY_DIRECTION,
}


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
