"""Friction models A to F over velocity (thesis 6.1 to 6.3): parametric and tensor-product, without and with hysteresis.

A: Stribeck (3.6). B: TP model of A. C: TP model directly from the measurement. D: Stribeck while accelerating, Coulomb
and viscous with constants of its own while slowing (6.21). E: TP models of D, F: directly from the measurement, one a
branch. The TP models hold S(v) = a22(v) = F(v) / (m v) of (2.48), so that F(v) = m v S(v).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.figure import Figure
from pneucli.identify.friction.regression import FrictionFit, fit_coulomb, fit_stribeck, velocity_friction
from pneucli.identify.friction.samples import Branch, MovingSamples
from pneucli.tp import TPModel, transform

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


MIN_BRANCH_SAMPLES = 50  # of a branch, or of one direction of it
MIN_NODE_SUPPORT = 0.5  # samples at an outermost node of a direct model, below which it does not count as measured


def _parametric_model(
    name: ModelName, domain: VelocityDomain, fits: Mapping[Branch, FrictionFit], offset: float
) -> FrictionModel:
    """Build model A or D from parametric fits."""
    return FrictionModel(name, domain, tuple(_parametric(domain, branch, fit) for branch, fit in fits.items()), offset)


def _parametric(domain: VelocityDomain, branch: Branch, fit: FrictionFit) -> ModelBranch:
    def force(v: Array) -> Array:
        v = np.asarray(v, dtype=np.float64)
        dry = velocity_friction(np.abs(v), fit) - fit["viscous"] * np.abs(v)
        return np.asarray(np.where(v == 0, 0.0, dry) * domain.sign(v) + fit["viscous"] * v)

    return ModelBranch(branch, force, fit.values())


def tp_from_model(name: ModelName, source: FrictionModel, mass: float) -> FrictionModel:
    """Build model B or E: the TP models of the branches of A or D."""
    branches = tuple(
        _tp_on_grid(branch_model, source.domain, source.domain.grid, mass) for branch_model in source.branches
    )
    return FrictionModel(name, source.domain, branches, source.offset)


def _tp_on_grid(branch_model: ModelBranch, domain: VelocityDomain, grid: Array, mass: float) -> ModelBranch:
    """Return the TP model of a branch on a grid of velocities."""
    nonzero = np.where(grid == 0, 1e-6 / domain.eta, grid)  # a22's limit at standstill
    return _tp_branch(grid, branch_model.branch, branch_model.force(nonzero) / (mass * nonzero), mass)


def tp_from_samples(
    name: ModelName,
    domain: VelocityDomain,
    samples: Mapping[Branch, MovingSamples],
    viscous: float,
    offset: float,
    mass: float,
) -> FrictionModel | None:
    """Build model C or F: TP models directly from the measured samples of each branch.

    A direction with fewer than ``MIN_BRANCH_SAMPLES`` samples mirrors the other. Beyond the measured velocities
    friction continues with the viscous slope; toward standstill it is constant.

    Args:
        name: "C" or "F".
        domain: The velocities of the model.
        samples: The moving samples of each branch.
        viscous: Viscous friction in N s/m.
        offset: Constant force in N, which is subtracted.
        mass: Moving mass in kg.

    Returns:
        The model; None where a branch has too few samples in both directions.

    References:
        Thesis, figure 4.1 (direct TP model transformation), theses 1 and 2 of chapter 8.
    """
    speed = np.maximum(np.abs(domain.grid), 1e-6 * domain.step)
    smoothed = np.abs(domain.sign(speed)) / (mass * speed)
    branches = []
    for branch, s in samples.items():
        directions = [
            direction_friction
            for d in (1, -1)
            if (direction_friction := _friction_of_direction(domain, s, viscous, offset, d))
        ]
        if not directions:
            return None
        levels = [np.interp(speed, *direction_friction) for direction_friction in (directions[0], directions[-1])]
        level = np.where(domain.grid >= 0, *levels)
        branches.append(_tp_branch(domain.grid, branch, level * smoothed, mass))
    return FrictionModel(name, domain, tuple(branches), offset)


def _friction_of_direction(
    domain: VelocityDomain, s: MovingSamples, viscous: float, offset: float, direction: int
) -> tuple[Array, Array] | None:
    """Return speeds (m/s) and measured friction (N) of one direction, by least squares; None with too few samples."""
    from pneucli.tp.sampling import fit_samples  # noqa: PLC0415 - brings scipy's sparse matrices

    nodes = domain.uniform_speeds
    speed = direction * s.v
    in_direction = (speed >= max(nodes[0], domain.resolved_velocity)) & (speed <= nodes[-1])
    if np.count_nonzero(in_direction) < MIN_BRANCH_SAMPLES:
        return None
    friction = direction * (s.friction[in_direction] - offset)
    found = fit_samples(speed[in_direction], friction, (nodes,), sigma=s.sigma[in_direction])
    supported = np.flatnonzero(found.support >= MIN_NODE_SUPPORT)
    first, last = supported[0], supported[-1]
    beyond = viscous * np.maximum(nodes - nodes[last], 0.0)
    return nodes, found.samples[np.clip(np.arange(nodes.size), first, last)] + beyond


def _tp_branch(grid: Array, branch: Branch, a22: Array, mass: float) -> ModelBranch:
    tp = transform(a22[:, None, None], (grid,))

    def force(v: Array) -> Array:
        return np.asarray(mass * v * tp.evaluate(v)[..., 0, 0])

    return ModelBranch(branch, force, tp=tp)


def identify_models(
    samples: MovingSamples, both: FrictionFit, domain: VelocityDomain, mass: float
) -> tuple[FrictionModel, ...]:
    """Identify the models A to F from moving samples.

    Args:
        samples: The moving samples.
        both: The Stribeck fit of all samples.
        domain: The velocities of the models.
        mass: Moving mass in kg.

    Returns:
        The models; those that need a branch with too few samples are missing.

    References:
        Thesis 6.1 to 6.3.
    """
    a, viscous = _parametric_model("A", domain, {"both": both}, both["offset"]), both.values()["viscous"].low
    candidates: list[FrictionModel | None] = [
        a,
        tp_from_model("B", a, mass),
        tp_from_samples("C", domain, {"both": samples}, viscous, a.offset, mass),
    ]
    branch_samples: dict[Branch, MovingSamples] = {
        "accelerating": samples.select(samples.branch > 0),
        "slowing": samples.select(samples.branch < 0),
    }
    if all(len(s) >= MIN_BRANCH_SAMPLES for s in branch_samples.values()):
        offset = _common_offset(branch_samples)
        d = _parametric_model("D", domain, _branch_fits(branch_samples, offset), offset)
        candidates += [
            d,
            tp_from_model("E", d, mass),
            tp_from_samples("F", domain, branch_samples, viscous, offset, mass),
        ]
    return tuple(m for m in candidates if m is not None)


def _common_offset(branch_samples: Mapping[Branch, MovingSamples]) -> float:
    """Return the constant force (N) of both branches, weighted by their precision; 0 where it is not identifiable."""
    if not all(s.both_directions for s in branch_samples.values()):
        return 0.0
    offsets = [
        fit.values()["offset"]
        for fit in (
            fit_stribeck(branch_samples["accelerating"], offset=True),
            fit_coulomb(branch_samples["slowing"], offset=True),
        )
    ]
    return float(np.average([v.value for v in offsets], weights=[(v.high - v.low) ** -2.0 for v in offsets]))


def _branch_fits(branch_samples: Mapping[Branch, MovingSamples], offset: float) -> dict[Branch, FrictionFit]:
    rising, falling = (
        replace(branch_samples[b], friction=branch_samples[b].friction - offset) for b in ("accelerating", "slowing")
    )
    return {"accelerating": fit_stribeck(rising, offset=False), "slowing": fit_coulomb(falling, offset=False)}
