"""Friction models A to F (thesis 6.1 to 6.3): parametric and tensor-product, without and with hysteresis.

A: Stribeck (3.6). B: TP model of A. C: TP model directly from the measurement. D: Stribeck while speeding up, Coulomb
and viscous with constants of its own while slowing (6.21). E: TP models of D, F: directly from the measurement, one
per branch. The TP models hold S(v) = a22(v) = F(v) / (m v) of (2.48), so that F(v) = m v S(v).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.friction.binned_curve import Branch
from pneucli.identify.friction.regression import FrictionFit, fit_coulomb, fit_stribeck, velocity_friction
from pneucli.identify.friction.samples import IntervalEstimate, MovingSamples
from pneucli.tp import TPModel, fit_samples, transform

Array = NDArray[np.float64]
ModelName = Literal["A", "B", "C", "D", "E", "F"]

TITLES: dict[ModelName, str] = {
    "A": "Stribeck friction",
    "B": "TP model of A",
    "C": "TP model of the measurement",
    "D": "Stribeck friction while speeding up, Coulomb and viscous while slowing",
    "E": "TP models of D, one per branch",
    "F": "TP models of the measurement, one per branch",
}
DEFAULT_NODES = 1000  # nodes of the thesis
SIGN_AT_RESOLVED_VELOCITY = 0.95  # what the smoothed sign reaches at the velocity that the sensors resolve
MIN_BRANCH_SAMPLES = 50  # samples that a branch, or one direction of it, is identified from
MIN_NODE_SUPPORT = 0.5  # samples at a node, below which the outermost nodes of a direct model do not count as measured


@dataclass(frozen=True)
class VelocityDomain:
    """Velocities on which the models live: ``nodes`` from -``max_velocity`` to ``max_velocity`` (m/s), and the sign's steepness.

    The nodes' distance grows with the velocity beyond what the sensors resolve, as a22 falls with it: at equal
    distances its straight lines would lie above friction near standstill, by as much as holds a piston that has just
    broken away. ``eta`` (s/m) is such that the sign of (6.22) reaches 0.95 at the velocity that the sensors resolve
    (``resolved_velocity``, m/s) or at two steps of the grid, whichever is larger: below, neither tells friction from
    its smoothing. ``steepness`` (s/m) states eta instead.
    """

    max_velocity: float
    resolved_velocity: float
    nodes: int = DEFAULT_NODES
    steepness: float | None = None

    @property
    def grid(self) -> Array:
        """The nodes, shape (nodes,), m/s; standstill is none of them where their number is even."""
        most = np.arcsinh(self.max_velocity / self.resolved_velocity)
        return np.asarray(self.resolved_velocity * np.sinh(np.linspace(-most, most, self.nodes)))

    @property
    def uniform_speeds(self) -> Array:
        """As many positive speeds, (n,), in m/s at equal distances: a measurement is averaged alike at all of them."""
        speeds = np.linspace(-self.max_velocity, self.max_velocity, self.nodes)
        return speeds[speeds > 0]

    @property
    def step(self) -> float:
        """Distance of the two nodes beside standstill in m/s."""
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
    """One branch of a model: ``force`` (N) over ``v`` (m/s), shape (n,) or any other, the sign smoothed (6.22).

    ``parameters`` are those of a parametric branch, ``tp`` the TP model of a22 (1/s) of the others.
    """

    branch: Branch
    force: Callable[[Array], Array]
    parameters: Mapping[str, IntervalEstimate] = field(default_factory=dict)
    tp: TPModel | None = None


@dataclass(frozen=True)
class FrictionModel:
    """One of the models A to F; ``branches`` holds one for both, or one while speeding up and one while slowing.

    Friction is without the constant force ``offset`` (N, positive where it pushes toward x = 0) found beside it: by
    A for A to C, by D for D to F, since one law for two branches would take their difference for a force.
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
        """Return the branch that holds while speeding up, or while slowing."""
        return self.branches[0 if accelerating else -1]

    def force(self, v: Array, accelerating: NDArray[np.bool_] | bool = True) -> Array:
        """Return the friction force (N) at ``v`` (m/s) where ``accelerating`` says which branch; shapes broadcast.

        The domain's ends hold for velocities beyond it.
        """
        inside = np.clip(v, -self.domain.max_velocity, self.domain.max_velocity)
        up, down = (self.branch(accelerating=b).force(inside) for b in (True, False))
        return np.where(accelerating, up, down)

    def level(self, v: Array, *, accelerating: bool) -> Array:
        """Return the magnitude of friction (N) at ``v`` (m/s) with a true sign in place of the smoothed.

        Nearer to standstill than half a step of the grid (m/s) the value there holds.
        """
        clear = np.where(v < 0, -1.0, 1.0) * np.maximum(np.abs(v), 0.5 * self.domain.step)
        return np.asarray(self.force(clear, accelerating) / self.domain.sign(clear))


def parametric_model(
    name: ModelName, domain: VelocityDomain, fits: Mapping[Branch, FrictionFit], offset: float
) -> FrictionModel:
    """Return model A (one fit, of ``both``) or D (``accelerating`` and ``slowing``)."""
    return FrictionModel(name, domain, tuple(_parametric(domain, branch, fit) for branch, fit in fits.items()), offset)


def _parametric(domain: VelocityDomain, branch: Branch, fit: FrictionFit) -> ModelBranch:
    def force(v: Array) -> Array:
        v = np.asarray(v, dtype=np.float64)
        dry = velocity_friction(np.abs(v), fit) - fit["viscous"] * np.abs(v)
        return np.asarray(np.where(v == 0, 0.0, dry) * domain.sign(v) + fit["viscous"] * v)

    return ModelBranch(branch, force, fit.values())


def tp_from_model(name: ModelName, source: FrictionModel, mass: float) -> FrictionModel:
    """Return model B or E: the TP models of the branches of A or D."""
    branches = tuple(_tp_on_grid(one, source.domain, source.domain.grid, mass) for one in source.branches)
    return FrictionModel(name, source.domain, branches, source.offset)


def _tp_on_grid(one: ModelBranch, domain: VelocityDomain, grid: Array, mass: float) -> ModelBranch:
    """Return the TP model of a branch on any grid."""
    safe = np.where(grid == 0, 1e-6 / domain.eta, grid)  # a22's limit at standstill
    return _tp_branch(grid, one.branch, one.force(safe) / (mass * safe), mass)


def tp_from_samples(
    name: ModelName,
    domain: VelocityDomain,
    samples: Mapping[Branch, MovingSamples],
    viscous: float,
    offset: float,
    mass: float,
) -> FrictionModel | None:
    """Return model C or F: TP models directly from the measured samples of each branch, less the ``offset`` (N).

    A direction with fewer than ``MIN_BRANCH_SAMPLES`` samples mirrors the other. Beyond the measured velocities
    friction goes on with the slope ``viscous`` (N s/m), toward standstill it is held. None where a branch has too few
    in either.
    """
    speed = np.maximum(np.abs(domain.grid), 1e-6 * domain.step)
    smoothed = np.abs(domain.sign(speed)) / (mass * speed)
    branches = []
    for branch, s in samples.items():
        sides = [side for d in (1, -1) if (side := _friction_of_direction(domain, s, viscous, offset, d))]
        if not sides:
            return None
        levels = [np.interp(speed, *side) for side in (sides[0], sides[-1])]
        level = np.where(domain.grid >= 0, *levels)
        branches.append(_tp_branch(domain.grid, branch, level * smoothed, mass))
    return FrictionModel(name, domain, tuple(branches), offset)


def _friction_of_direction(
    domain: VelocityDomain, s: MovingSamples, viscous: float, offset: float, direction: int
) -> tuple[Array, Array] | None:
    """Return speeds (m/s) and the friction (N) measured in one direction, by least squares; None without."""
    nodes = domain.uniform_speeds
    speed = direction * s.v
    mine = (speed >= max(nodes[0], domain.resolved_velocity)) & (speed <= nodes[-1])
    if np.count_nonzero(mine) < MIN_BRANCH_SAMPLES:
        return None
    friction = direction * (s.friction[mine] - offset)
    found = fit_samples(speed[mine], friction, (nodes,), sigma=s.sigma[mine])
    seen = np.flatnonzero(found.support >= MIN_NODE_SUPPORT)
    first, last = seen[0], seen[-1]
    beyond = viscous * np.maximum(nodes - nodes[last], 0.0)
    return nodes, found.samples[np.clip(np.arange(nodes.size), first, last)] + beyond


def _tp_branch(grid: Array, branch: Branch, a22: Array, mass: float) -> ModelBranch:
    tp = transform(a22[:, None, None], (grid,))

    def force(v: Array) -> Array:
        return np.asarray(mass * v * tp.evaluate(v)[..., 0, 0])

    return ModelBranch(branch, force, tp=tp)


def identify_models(
    samples: MovingSamples, both: FrictionFit, domain: VelocityDomain, mass: float
) -> tuple[tuple[FrictionModel, ...], list[str]]:
    """Return the models A to F of the samples, and warnings about those that too few samples do not give."""
    a, viscous = parametric_model("A", domain, {"both": both}, both["offset"]), both.values()["viscous"].ci_low
    found: list[FrictionModel | None] = [
        a,
        tp_from_model("B", a, mass),
        tp_from_samples("C", domain, {"both": samples}, viscous, a.offset, mass),
    ]
    parts: dict[Branch, MovingSamples] = {
        "accelerating": samples.select(samples.branch > 0),
        "slowing": samples.select(samples.branch < 0),
    }
    if all(len(s) >= MIN_BRANCH_SAMPLES for s in parts.values()):
        offset = _common_offset(parts)
        d = parametric_model("D", domain, _branch_fits(parts, offset), offset)
        found += [d, tp_from_model("E", d, mass), tp_from_samples("F", domain, parts, viscous, offset, mass)]
    models = tuple(m for m in found if m is not None)
    missing = [name for name in TITLES if name not in {m.name for m in models}]
    counts = ", ".join(f"{len(s)} {name}" for name, s in parts.items())
    return models, [f"no model {', '.join(missing)}: too few moving samples ({counts})"] if missing else []


def _common_offset(parts: Mapping[Branch, MovingSamples]) -> float:
    """Return the constant force in N beside both branches, weighed by how sure each is; 0 where it can't be told."""
    if not all(s.both_directions for s in parts.values()):
        return 0.0
    told = [
        fit.values()["offset"]
        for fit in (fit_stribeck(parts["accelerating"], offset=True), fit_coulomb(parts["slowing"], offset=True))
    ]
    return float(np.average([v.value for v in told], weights=[(v.ci_high - v.ci_low) ** -2.0 for v in told]))


def _branch_fits(parts: Mapping[Branch, MovingSamples], offset: float) -> dict[Branch, FrictionFit]:
    rising, falling = (replace(parts[b], friction=parts[b].friction - offset) for b in ("accelerating", "slowing"))
    return {"accelerating": fit_stribeck(rising, offset=False), "slowing": fit_coulomb(falling, offset=False)}


def grid_convergence(source: FrictionModel, mass: float, sizes: Sequence[int]) -> list[tuple[int, float]]:
    """Return, for each number of nodes, the rms deviation in N of the TP models (E of D, B of A) from their source.

    The smoothed sign is the source's throughout: the grid alone changes.
    """
    fine = np.linspace(-source.domain.max_velocity, source.domain.max_velocity, 40_001)
    out = []
    for nodes in sizes:
        grid = replace(source.domain, nodes=nodes).grid
        copies = [_tp_on_grid(one, source.domain, grid, mass) for one in source.branches]
        errors = [copy.force(fine) - one.force(fine) for copy, one in zip(copies, source.branches, strict=True)]
        out.append((nodes, float(np.sqrt(np.mean(np.square(errors))))))
    return out
