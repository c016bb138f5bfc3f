"""Scenario design: gains that hold the limits on an ensemble of rigs, and the probability that fresh rigs promise.

The rigs of the ensemble are those that the recordings allow: parameters within their intervals, the rig's tolerances,
and all at once what most rigs have and the model may lack (``untold`` of the effects). Gains are searched within a
small family on one set of rigs; the promise comes from others that the search never saw, so that it needs no convexity:
of N of them k hold, and the probability has the lower bound of Clopper and Pearson (randomised algorithms, Tempo, Bai
and Dabbene 1997).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import product

import numpy as np

from pneucli.arrays import Array
from pneucli.closed_loop.robustness import TOLERANCES, drawn_model
from pneucli.closed_loop.scenarios import equilibrium_at
from pneucli.closed_loop.simulation import ClosedLoopSetup, Scenario, simulate
from pneucli.controller import layout
from pneucli.controller.parameters import Controller, nominal_load
from pneucli.design.bandwidths import CASCADE_RATIO, pressure_corner
from pneucli.design.control_laws import DesignData
from pneucli.design.requirements import Requirements
from pneucli.executors import map_in_threads, thread_count
from pneucli.physics.declaration import Effect, consists_of_times
from pneucli.physics.effects import catalogue
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities

SEARCH_RIGS, PROOF_RIGS = 24, 100  # rigs of the search, and fresh ones of the promise
EXPLAINED_RIGS = 20  # of those that fail, run again without each effect: a share to 0.11 (1 sigma) names what limits
LAW_RIGS, LAW_SEARCH_RIGS = 20, 5  # fresh rigs that compare the other laws, and those of their search
SCREENING_RIGS, KEPT = 5, 0.125  # rigs that every member of the family meets, and share of those that meet all
SEARCH_SEED, PROOF_SEED = 0, 1  # of their draws
CONFIDENCE = 0.95  # of the promise
SUPPLY_SPREAD = 0.1  # of the supply pressure, either way
REST_LIMIT, MOTION_LIMIT, LOAD_LIMIT = 50e-6, 0.5e-3, 100e-6  # m, where [design] states nothing
WORST_RATIO = 1e3  # over its limit: of a loop that runs away
BEST_RATIO = 0.1  # over its limit, of a score: a wider margin counts no more
# of the figures, up to which a held piston stays where it is: no margin of the gains
HELD_RATIOS = (0.9, 0.0, 0.45, 0.0)
SHARPNESS = 4.0  # of a score: a kernel of about the width that figures of 5 to 25 rigs, half a decade apart, ask for
FIGURES = {"rest": "m", "motion": "m", "load": "m", "chattering": "V"}  # of a rig, in the order of its ratios
CHATTERING_LIMIT, CHATTERING_PERIOD = 0.2, 0.02  # of the largest command, rms; s: what is faster is chattering
DWELL, SINE = 2.0, 2.5  # s, of each stretch of the test, and of its sine
FREQUENCY, AMPLITUDE = 0.5, 0.15  # Hz; of the stroke, what a closed chamber's air spring allows
JUDGED = 0.4  # s, at the end of a stretch at rest
LAGS = (0.0, 2.5e-3, 5e-3, 7.5e-3)  # s: spool lag that the controller leads and plans for, where the model has none
PRESSURE_SHARES = (1.0, 0.7, 0.5, 0.35)  # of the pressure loop's corner by the rules
POSITION_SHARES = (1.0, 1.4, 2.0)  # of the position loop's corner over the pressure loop's


@dataclass(frozen=True)
class RigEnsemble:
    """Rigs that the recordings allow.

    Attributes:
        model: The identified model.
        sigma: 1 sigma of identified parameters by name.
        effects: The effects that most rigs have and the model lacks.
    """

    model: Model
    sigma: Mapping[str, float]
    effects: tuple[str, ...]

    def draw(self, seed: int, k: int, without: str = "") -> Model:
        """Return rig k of a seed; ``without`` an effect it is the same rig but for that."""
        rng = np.random.default_rng([seed, k])
        supply = self.model.base_values()["rig.supply_pressure"] * (1.0 + SUPPLY_SPREAD * rng.uniform(-1.0, 1.0))
        model = drawn_model(self.model, self.sigma, TOLERANCES, rng).with_values({"rig.supply_pressure": supply})
        sizes: dict[str, float] = {}
        rig = rig_quantities(model)
        for name in self.effects:
            untold = catalogue()[name].untold
            drawn = untold.draw(rng, rig) if untold else {}
            if name != without:
                sizes |= {f"{name}.{key}": size for key, size in drawn.items()}
        added = tuple(catalogue()[name] for name in self.effects if name != without)
        return replace(model, effects=(*model.effects, *added)).with_values(sizes)


def ensemble_of(model: Model, sigma: Mapping[str, float]) -> RigEnsemble:
    """Return the ensemble of a model, with those effects of most rigs that it lacks."""
    known = {effect.name for effect in model.effects}
    lacks = [e.name for e in catalogue().values() if e.untold and not known & {e.name, *e.untold.apart}]
    return RigEnsemble(model, sigma, tuple(lacks))


@dataclass(frozen=True)
class RigTest:
    """One run with steps both ways, a load on and off, and a sine, and the limits of its ``FIGURES``."""

    scenario: Scenario
    limits: tuple[float, float, float, float]
    period: float

    def ratios(self, model: Model, controller: Controller, setup: ClosedLoopSetup, seed: int) -> Array:
        """Return the figures of a run over their limits, shape (4,)."""
        supplied = self.scenario.supplied_by(model, controller)
        run = simulate(model, controller, supplied, setup, seed)
        return self.judged(run.model[:, at.X], run.log[:, layout.L_U1])

    def judged(self, x: Array, u: Array) -> Array:
        """Return the figures of a run over their limits, shape (4,); motion and chattering are rms.

        Args:
            x: Position in m, shape (samples,).
            u: Command in V, shape (samples,).
        """
        error = np.abs(np.nan_to_num(self.scenario.reference - x, nan=np.inf))
        ends = [round(i * DWELL / self.period) for i in range(1, 5)]
        rests = [float(error[end - round(JUDGED / self.period) : end].max()) for end in ends]
        moving = error[ends[-1] + round(1.0 / self.period) :]
        found = np.array([
            max(rests[:2]), math.sqrt(float(np.mean(moving**2))), max(rests[2:]), chattering(u, self.period)
        ])  # fmt: skip
        return np.asarray(np.minimum(found / np.array(self.limits), WORST_RATIO))


def chattering(u: Array, period: float) -> float:
    """Return the rms in V of a command, shape (n,), beside its mean over ``CHATTERING_PERIOD``.

    >>> time = 1e-3 * np.arange(4000)
    >>> slow, fast = (chattering(np.sin(2 * np.pi * f * time), 1e-3) for f in (1.0, 200.0))
    >>> round(slow, 3), round(fast, 2)
    (0.001, 0.67)
    """
    width = max(round(CHATTERING_PERIOD / period) // 2 * 2 + 1, 3)
    total = np.concatenate([[0.0], np.cumsum(u)])
    mean = (total[width:] - total[:-width]) / width
    half = width // 2
    return float(np.sqrt(np.mean((u[half:-half] - mean) ** 2)))


def rig_test(controller: Controller, requirements: Requirements) -> RigTest:
    """Return the test of each rig: what ``[design]`` asks, or 50 um at rest, 0.5 mm in motion, 100 um under a load."""
    c, h = controller.values, controller.period
    time = np.arange(round((4.0 * DWELL + SINE) / h)) * h
    stretch = np.minimum((time / DWELL + 1e-9).astype(int), 4)
    way = np.where(stretch == 0, 1.0, -1.0)
    way = np.where(stretch == 4, -np.cos(2.0 * np.pi * FREQUENCY * (time - 4.0 * DWELL)), way)
    centre = 0.5 * c["C_STROKE"]
    rest = requirements.tolerance or REST_LIMIT
    scenario = Scenario(
        "ensemble",
        centre + AMPLITUDE * c["C_STROKE"] * way,
        np.where(stretch == 2, -nominal_load(c), 0.0),  # that chamber 1 must carry: a closed chamber 2 pushes no harder
        np.full(time.size, c["C_SUPPLY"]),
        equilibrium_at(c, centre),
    )
    fast = CHATTERING_LIMIT * c["C_U_MAX"]
    limits = (rest, requirements.tracking_error or MOTION_LIMIT, max(LOAD_LIMIT, 2.0 * rest), fast)
    return RigTest(scenario, limits, h)


@dataclass(frozen=True)
class Choice:
    """A member of the family: spool lag (s) that is planned for, shares of both corners, and its score, least best."""

    lag: float
    pressure: float
    position: float
    score: float = math.inf


def spool_lag() -> Effect:
    """Return the effect that delays the opening of the valve on most rigs: a time alone, between command and spool."""
    return next(e for e in catalogue().values() if e.untold and "command" in e.ports and consists_of_times(e))


def chosen_requirements(choice: Choice, model: Model, requirements: Requirements) -> tuple[Model, Requirements]:
    """Return the model and the requirements from which a member of the family of ``best`` is designed."""
    if choice.lag > 0.0:
        spool = spool_lag()
        name = f"{spool.name}.{spool.parameters[0].name}"
        model = replace(model, effects=(*model.effects, spool)).with_values({name: choice.lag})
    corner = pressure_corner(model, requirements)
    pressure = choice.pressure * corner
    position = choice.position * pressure / CASCADE_RATIO
    hz = 2.0 * math.pi
    return model, replace(requirements, pressure_bandwidth=pressure / hz, position_bandwidth=position / hz)


def chosen_data(choice: Choice, data: DesignData) -> DesignData:
    """Return the data from which a member of the family of another law is designed, which plans for no lag."""
    corners, slower = data.bandwidths, choice.pressure * choice.position
    scaled = replace(
        corners,
        pressure=choice.pressure * corners.pressure,
        flow_observer=choice.pressure * corners.flow_observer,
        motion_observer=choice.pressure * corners.motion_observer,
        position=slower * corners.position,
    )
    return replace(data, bandwidths=scaled, surface_slope=slower * data.surface_slope)


def ratios_on(rigs: Mapping[int, Model], test: RigTest, controller: Controller, setup: ClosedLoopSetup) -> Array:
    """Return the figures over their limits on rigs by number, which seeds the noise, shape (rigs, 4); on all cores."""

    def one(k: int) -> Array:
        return test.ratios(rigs[k], controller, setup, k)

    return np.reshape(map_in_threads(one, list(rigs), thread_count()), (-1, len(FIGURES)))


def score_of(ratios: Array) -> float:
    """Return about the share of rigs that fail: the mean of a smooth step of the worst figure of each over its limit.

    A rig near its limit counts as one that may fail, and one that fails by far not more than others.

    Args:
        ratios: Figures over their limits, shape (rigs, 4).

    >>> near, far = np.array([[0.1, 1.0, 0.1, 0.1]]), np.array([[0.9, 0.1, 0.1, 100.0]])
    >>> round(score_of(near), 3), round(score_of(far), 3)
    (0.5, 1.0)
    """
    worst = np.where(ratios <= np.array(HELD_RATIOS), 0.0, ratios).max(axis=1)
    step = np.maximum(worst, BEST_RATIO) ** SHARPNESS
    return float(np.mean(step / (1.0 + step)))


def measured_times(ensemble: RigEnsemble, model: Model) -> RigEnsemble:
    """Return the ensemble of a machine whose lags and delays are measured: that of ``model``, with no further ones."""
    known = {effect.name for effect in model.effects}
    left = [n for n in ensemble.effects if n not in known and not consists_of_times(catalogue()[n])]
    return RigEnsemble(model, ensemble.sigma, tuple(left))


def family_of(ensemble: RigEnsemble) -> list[Choice]:
    """Return the members of the family, the rules first; a lag that the model knows is planned for anyway."""
    lags = LAGS if spool_lag().name in ensemble.effects else (0.0,)
    return [Choice(*one) for one in product(lags, PRESSURE_SHARES, POSITION_SHARES)]


def search(
    ensemble: RigEnsemble,
    make: Callable[[Choice], Controller],
    setup: ClosedLoopSetup,
    test: RigTest,
    family: Sequence[Choice],
    progress: Callable[[float], None] = lambda share: None,
    count: int = SEARCH_RIGS,
) -> Choice:
    """Return the member of a family that holds the limits best on the model and ``count`` rigs.

    All of the family competes on the first ``SCREENING_RIGS`` rigs, the better ``KEPT`` on all.
    """
    rigs = [ensemble.model, *(ensemble.draw(SEARCH_SEED, k) for k in range(1, count + 1))]
    controllers: dict[int, Controller] = {}

    def ratios(i: int, k: int) -> Array:
        if i not in controllers:
            controllers[i] = make(family[i])
        return test.ratios(rigs[k], controllers[i], setup, k)

    done: list[list[Array]] = [[] for _ in family]
    screened = least_scores(done, ratios, min(SCREENING_RIGS, len(rigs)), math.ceil(len(family) * KEPT), progress)
    kept = [done[i] for i in screened]
    best = least_scores(kept, lambda i, k: ratios(screened[i], k), len(rigs), 1)[0]
    return replace(family[screened[best]], score=score_of(np.array(kept[best])))


def least_scores(
    done: list[list[Array]],
    ratios: Callable[[int, int], Array],
    rigs: int,
    wanted: int,
    progress: Callable[[float], None] = lambda share: None,
) -> list[int]:
    """Return the candidates of the ``wanted`` least scores on rigs 0 to ``rigs`` - 1, the least first.

    The candidate with the least bound runs its next rig; its bound is its score if every further rig were held with the
    best ratio. What is complete with the least bound has the least score; what cannot be among those runs no further.

    Args:
        done: Figures over their limits of the rigs that each candidate ran, each (4,); extended.
        ratios: Runs candidate i on rig k.
        rigs: Number of rigs.
        wanted: Number of candidates.
        progress: Told the share of all runs that are done; most need not be.
    """

    def bound(i: int) -> tuple[float, int]:
        return score_of(np.vstack([*done[i], np.full((rigs - len(done[i]), len(FIGURES)), BEST_RATIO)])), i

    heap, found, threads = sorted(bound(i) for i in range(len(done))), list[int](), thread_count()
    while len(found) < wanted:
        batch: list[int] = []
        while heap and len(batch) < threads and len(done[heap[0][1]]) < rigs:
            batch.append(heappop(heap)[1])
        if not batch:
            found.append(heappop(heap)[1])
        progress(sum(map(len, done)) / (rigs * len(done)))
        for i, ratio in zip(batch, map_in_threads(lambda i: ratios(i, len(done[i])), batch, threads), strict=True):
            done[i].append(ratio)
            heappush(heap, bound(i))
    return found


@dataclass(frozen=True)
class Proof:
    """What a controller does on fresh rigs.

    Attributes:
        ratios: Figures over their limits, shape (rigs, 4).
        explained: Rigs that fail and ran without each effect.
        rescued: Those of them that hold without one effect, by effect.
    """

    ratios: Array
    explained: int
    rescued: Mapping[str, int]

    @property
    def held(self) -> int:
        """How many rigs hold all limits."""
        return int(np.sum(self.ratios.max(axis=1) <= 1.0))

    @property
    def probability(self) -> float:
        """The probability with which a further rig holds all limits, at least, with ``CONFIDENCE``."""
        return probability_at_least(self.held, len(self.ratios))

    @property
    def limiting(self) -> str:
        """The effect without which most of the explained rigs would hold; "" where none fails or none helps."""
        best = max(self.rescued, key=lambda name: self.rescued[name], default="")
        return best if best and self.rescued[best] > 0 else ""


def probability_at_least(held: int, rigs: int) -> float:
    """Return the lower bound of a probability of which ``held`` of ``rigs`` independent draws are a sample.

    References:
        Clopper and Pearson (1934), one-sided.

    >>> round(probability_at_least(59, 59), 3), round(probability_at_least(95, 100), 3), probability_at_least(0, 9)
    (0.95, 0.898, 0.0)
    """
    from scipy.stats import beta  # noqa: PLC0415 - slow to import

    return float(beta.ppf(1.0 - CONFIDENCE, held, rigs - held + 1)) if held else 0.0


def prove(
    controller: Controller,
    ensemble: RigEnsemble,
    test: RigTest,
    setup: ClosedLoopSetup,
    rigs: int = PROOF_RIGS,
    *,
    explained: bool = True,
) -> Proof:
    """Run a controller on rigs that no search saw; where ``explained``, some of those that fail without each effect."""
    found = ratios_on({k: ensemble.draw(PROOF_SEED, k) for k in range(rigs)}, test, controller, setup)
    failed = [int(k) for k in np.flatnonzero(found.max(axis=1) > 1.0)][: EXPLAINED_RIGS * explained]
    rescued = {}
    for name in ensemble.effects if explained else ():
        without = ratios_on({k: ensemble.draw(PROOF_SEED, k, name) for k in failed}, test, controller, setup)
        rescued[name] = int(np.sum(without.max(axis=1) <= 1.0))
    return Proof(found, len(failed), rescued)
