"""A friction model over velocity: its domain, its branches, and the smoothed sign (thesis 6.22)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.figure import Figure
from pneucli.identify.friction.samples import Branch
from pneucli.tp import TPModel

ModelName = Literal["A", "B", "C", "D", "E", "F"]
TITLES: dict[ModelName, str] = {
    "A": "Stribeck friction",
    "B": "TP model of A",
    "C": "TP model of the measurement",
    "D": "Stribeck friction while speeding up, Coulomb and viscous while slowing",
    "E": "TP models of D, one per branch",
    "F": "TP models of the measurement, one per branch",
}
DEFAULT_NODES = 1000  # as in the thesis
SIGN_AT_RESOLVED_VELOCITY = 0.95  # value of the smoothed sign at the velocity that the sensors resolve


@dataclass(frozen=True)
class VelocityDomain:
    """The velocities of the models: ``nodes`` from -``max_velocity`` to ``max_velocity`` (m/s), and the sign's slope.

    The distance of nodes grows with the velocity beyond what the sensors resolve, as a22 falls with it: at equal
    distances its straight lines would lie above friction near standstill by enough to hold a piston that has just
    broken away. ``eta`` (s/m) is chosen so that the sign of (6.22) reaches 0.95 at the velocity that the sensors
    resolve (``resolved_velocity``, m/s) or at two steps of the grid, whichever is larger: below it, friction and its
    smoothing cannot be distinguished. ``steepness`` (s/m) states eta instead.
    """

    max_velocity: float
    resolved_velocity: float
    nodes: int = DEFAULT_NODES
    steepness: float | None = None

    @property
    def grid(self) -> Array:
        """The nodes, shape (nodes,), m/s; an even number of nodes excludes standstill."""
        end = np.arcsinh(self.max_velocity / self.resolved_velocity)
        return np.asarray(self.resolved_velocity * np.sinh(np.linspace(-end, end, self.nodes)))

    @property
    def uniform_speeds(self) -> Array:
        """Equally spaced positive speeds, (n,), in m/s, at which measurements are averaged alike."""
        speeds = np.linspace(-self.max_velocity, self.max_velocity, self.nodes)
        return speeds[speeds > 0]

    @property
    def step(self) -> float:
        """Distance of the two nodes next to standstill in m/s."""
        return float(np.min(np.diff(self.grid)))

    @property
    def eta(self) -> float:
        """Steepness of the smoothed sign in s/m."""
        if self.steepness is not None:
            return self.steepness
        return float(
            np.log((1 + SIGN_AT_RESOLVED_VELOCITY) / (1 - SIGN_AT_RESOLVED_VELOCITY))
            / max(self.resolved_velocity, 2 * self.step)
        )

    def sign(self, v: Array) -> Array:
        """Return 2 / (1 + exp(-eta v)) - 1 (6.22)."""
        return np.tanh(0.5 * self.eta * v)


@dataclass(frozen=True)
class ModelBranch:
    """One branch of a model: ``force`` (N) over ``v`` (m/s), of any shape, with the smoothed sign (6.22).

    A parametric branch has ``parameters``, the others the TP model ``tp`` of a22 (1/s).
    """

    branch: Branch
    force: Callable[[Array], Array]
    parameters: Mapping[str, Figure] = field(default_factory=dict)
    tp: TPModel | None = None


@dataclass(frozen=True)
class FrictionModel:
    """One of the models A to F; ``branches`` holds one for both, or one for acceleration and one for deceleration.

    The constant force ``offset`` (N, positive where it pushes toward x = 0) is not part of friction. A determines it
    for A to C, D for D to F, since a single function for two branches would take their difference for a force.
    """

    name: ModelName
    domain: VelocityDomain
    branches: tuple[ModelBranch, ...]
    offset: float = 0.0

    @property
    def title(self) -> str:
        """What the model is."""
        return TITLES[self.name]

    def branch(self, *, accelerating: bool) -> ModelBranch:
        """Return the branch for acceleration or deceleration."""
        return self.branches[0 if accelerating else -1]

    def force(self, v: Array, accelerating: Mask | bool = True) -> Array:
        """Return the friction force (N) at ``v`` (m/s) on the branch of ``accelerating``; shapes broadcast.

        Beyond the domain the value at its end holds.
        """
        inside = np.clip(v, -self.domain.max_velocity, self.domain.max_velocity)
        up, down = (self.branch(accelerating=b).force(inside) for b in (True, False))
        return np.where(accelerating, up, down)

    def level(self, v: Array, *, accelerating: bool) -> Array:
        """Return the magnitude of friction (N) at ``v`` (m/s) with a true sign instead of the smoothed one.

        Within half a step of the grid from standstill the value at half a step holds.
        """
        nonzero = np.where(v < 0, -1.0, 1.0) * np.maximum(np.abs(v), 0.5 * self.domain.step)
        return np.asarray(self.force(nonzero, accelerating) / self.domain.sign(nonzero))
