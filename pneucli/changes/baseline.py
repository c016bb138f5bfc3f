"""What a fitted model leaves for later comparisons: its parameters, and what each block of data says of them.

All recordings are fitted together, held out or not: what is asked later is not whether the model is right, but whether
the same model fits other recordings with the same parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.blocks import scores
from pneucli.identify.estimation.fit import Fit, fit
from pneucli.identify.estimation.least_squares import inverse
from pneucli.identify.estimation.model_fit import changes, free_parameters, starts
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.estimation.problem import Problem
from pneucli.identify.residuals import View
from pneucli.physics.declaration import Effect
from pneucli.physics.scales import Facts
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import facts_of

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-6  # of the power of an effect's signature: less is left of it where the model's parameters do the same


@dataclass(frozen=True)
class Coordinate:
    """One parameter of the model as it is compared: its value, or the logarithm of it."""

    name: str
    unit: str
    value: float
    logarithmic: bool
    at_bound: bool

    @property
    def place(self) -> float:
        """The coordinate."""
        return float(np.log(self.value)) if self.logarithmic else self.value

    def moved(self, place: float) -> Coordinate:
        """Return the parameter at another place."""
        return replace(self, value=float(np.exp(place)) if self.logarithmic else place)


@dataclass(frozen=True)
class Start:
    """An effect at typical values (by EFFECT.PARAMETER), which one step turns on by degrees.

    ``one_sided``: its null is a bound, so that a step below none means nothing.
    """

    effect: str
    values: Mapping[str, float]
    one_sided: bool = False


@dataclass(frozen=True)
class Reference:
    """A fit in its coordinates (k,), and effects that it lacks, by their starts (m,).

    ``influence`` (B, k): by how much each of B blocks of data moves the estimates; ``working`` (k, k): their covariance
    were the residuals white. ``steps`` (m,): by how many of its starts each effect is wanted, ``step_influence`` (B, m)
    what each block says of it, ``power`` (m,): the inverse of its variance were the residuals white, ``bias`` (k, m):
    what a step of it, not modelled, does to the estimates. ``levels`` (B,): the logarithm of each block's mean squared
    residual in units of noise. ``gram`` (m, m): the products of the effects' changes of the residual, where known.
    What is not kept for later: ``cross`` (m, B, k), by how much a step taken changes what each block adds to
    ``influence``, and ``share`` (B, m), the part of the power that stands in each block.
    """

    coordinates: tuple[Coordinate, ...]
    starts: tuple[Start, ...]
    influence: Array
    working: Array
    steps: Array
    step_influence: Array
    power: Array
    bias: Array
    levels: Array
    gram: Array | None = None
    cross: Array | None = None
    share: Array | None = None

    @property
    def places(self) -> Array:
        """The estimates (k,)."""
        return np.array([c.place for c in self.coordinates])

    def only(self, names: Sequence[str], starts: Sequence[Start]) -> Reference:
        """Return the reference with these coordinates and starts alone; what is left out is let free."""
        k = [[c.name for c in self.coordinates].index(n) for n in names]
        m = [self.starts.index(s) for s in starts]
        return replace(
            self,
            coordinates=tuple(self.coordinates[i] for i in k),
            starts=tuple(starts),
            influence=self.influence[:, k],
            working=self.working[np.ix_(k, k)],
            steps=self.steps[m],
            step_influence=self.step_influence[:, m],
            power=self.power[m],
            bias=self.bias[np.ix_(k, m)],
            cross=None if self.cross is None else self.cross[np.ix_(m, range(len(self.cross[0])), k)] if m else None,
            gram=None if self.gram is None else self.gram[np.ix_(m, m)],
            share=None if self.share is None else self.share[:, m],
        )

    def beside(self, i: int) -> Reference:
        """Return the reference with the effect of one start in the model, let free, so far as a linear step tells."""
        if self.gram is None or self.power[i] <= 0.0:
            return self
        leans = self.gram[i] / self.gram[i, i]
        gram = self.gram - np.outer(leans, self.gram[i])
        power = np.where(np.diag(gram) > NEGLIGIBLE * self.power, np.diag(gram), 0.0)
        inverted = np.divide(1.0, power, out=np.zeros_like(power), where=power > 0.0)
        scores, by_block = self.power * self.steps, self.power * self.step_influence
        bias, places = self.bias[:, i], self.places - self.bias[:, i] * self.steps[i]
        return replace(
            self,
            coordinates=tuple(c.moved(float(p)) for c, p in zip(self.coordinates, places, strict=True)),
            influence=self.influence - np.outer(self.step_influence[:, i], bias),
            working=self.working + np.outer(bias, bias) / self.power[i],
            steps=(scores - leans * scores[i]) * inverted,
            step_influence=(by_block - np.outer(by_block[:, i], leans)) * inverted,
            power=power,
            bias=self.bias - np.outer(bias, leans),
            gram=gram,
            cross=None,
            share=None,
        )


def aligned(old: Reference, new: Reference) -> tuple[Reference, Reference]:
    """Return both with the coordinates and starts that both have, in the order of the old one."""
    names = [c.name for c in old.coordinates if c.name in {n.name for n in new.coordinates}]
    starts = [s for s in old.starts if s in new.starts]
    return old.only(names, starts), new.only(names, starts)


def reference(
    model: Model, views: Sequence[View], effects: Iterable[Effect], known: Sequence[Start] | None = None
) -> tuple[Fit, Reference]:
    """Fit a model to all views; return the fit and what it leaves for comparisons.

    ``effects`` are those that it lacks; they stand at their typical values, or at the ``known`` starts of another
    reference, so that both can be compared.
    """
    found = fit(model, views, free_parameters(model, views))
    return found, reference_at(found, views, effects, known)


def reference_at(
    found: Fit, views: Sequence[View], effects: Iterable[Effect], known: Sequence[Start] | None = None
) -> Reference:
    """Return what a fit leaves for comparisons, as :func:`reference`."""
    bread, scale = _bread(found, views), _scales(found)
    lacking = {e.name: e for e in effects}
    asked = list(_starts(lacking, found, views)) if known is None else [s for s in known if s.effect in lacking]
    bounded = [lacking[start.effect].bounds for start in asked]
    beyond, rows = np.zeros((len(asked), found.residual.size), dtype=np.float32), []
    for i, (change, only) in enumerate(zip(_changes(asked, lacking, found, views), bounded, strict=True)):
        row, beyond[i] = _step(found, bread, change, known=not only)
        rows.append(row)
    power, steps, step_influence, bias, cross, share = zip(*rows, strict=True) if rows else ((),) * 6
    count, k = int(found.blocks.max()) + 1, len(found.free)
    return Reference(
        coordinates=tuple(_coordinate(found, name.name, name.unit, name.logarithmic) for name in found.free),
        starts=tuple(asked),
        influence=-scores(found.jacobian, found.residual, found.blocks) @ bread * scale,
        working=bread * np.outer(scale, scale),
        steps=np.array(steps, dtype=np.float64),
        step_influence=np.array(step_influence).reshape(len(rows), count).T,
        power=np.array(power, dtype=np.float64),
        bias=np.array(bias).reshape(len(rows), k).T * scale[:, None],
        levels=_levels(found),
        gram=np.asarray(beyond @ beyond.T, dtype=np.float64),
        cross=np.array(cross).reshape(len(rows), count, k) * scale,
        share=np.array(share).reshape(len(rows), count).T,
    )


def _bread(found: Fit, views: Sequence[View]) -> Array:
    """Return the inverse of the curvature that data and prior give (k, k)."""
    problem = Problem(found.model, views, found.free, found.errors)
    at = np.array([f.inward(found[f.name].value) for f in found.free])
    prior = problem.prior_jacobian(at)
    return inverse(found.jacobian.T @ found.jacobian + prior.T @ prior)


def _scales(found: Fit) -> Array:
    """Return d coordinate / d (the fit's coordinate), shape (k,)."""
    return np.array([1.0 if f.logarithmic else f.scale for f in found.free])


def _coordinate(found: Fit, name: str, unit: str, logarithmic: bool) -> Coordinate:
    estimate = found[name]
    return Coordinate(name, unit, estimate.value, logarithmic, estimate.at_bound)


def _starts(effects: Mapping[str, Effect], found: Fit, views: Sequence[View]) -> Iterable[Start]:
    facts: Facts = facts_of(found.model, [v.experiment for v in views])
    for name, effect in effects.items():
        alone = [p for p in effect.parameters if p.null is not None]
        only = len(alone) == 1 and null_value(alone[0], found.model) == alone[0].on(facts).lower
        yield from (Start(name, values, only) for values in starts(effect, facts, found.model.rig.known))


def _changes(
    asked: Sequence[Start], effects: Mapping[str, Effect], found: Fit, views: Sequence[View]
) -> Iterable[Array]:
    for start in asked:
        change = next(iter(changes(effects[start.effect], found, views, [dict(start.values)])), None)
        yield np.zeros(found.residual.size) if change is None else change


def _step(found: Fit, bread: Array, change: Array, *, known: bool) -> tuple[tuple[Any, ...], Array]:
    """Return of an effect's change of the residual (N,) what the parameters cannot do (N,), and before that its power,
    step, influence of each block (B,), bias (k,), what a step changes of the parameters' influence (B, k), and the
    blocks' shares (B,).

    What it leaves is not ``known`` where it states bounds: within them it takes noise out as well.
    """
    count = int(found.blocks.max()) + 1
    change = np.where(np.isfinite(change), change, 0.0)
    bias = bread @ (found.jacobian.T @ change)
    new = change - found.jacobian @ bias
    power = float(new @ new)
    if power <= NEGLIGIBLE * float(change @ change):
        none = 0.0, 0.0, np.zeros(count), np.zeros(bias.size), np.zeros((count, bias.size)), np.zeros(count)
        return none, np.zeros(change.size)
    cross = -scores(found.jacobian, new, found.blocks) @ bread
    share = np.bincount(found.blocks, weights=new**2, minlength=count) / power
    scored = np.bincount(found.blocks, weights=new * found.residual, minlength=count)
    kept = (cross, share) if known else (np.zeros_like(cross), np.zeros_like(share))
    return (power, -float(scored.sum()) / power, -scored / power, bias, *kept), new


def _levels(found: Fit) -> Array:
    """Return the logarithm of each block's mean square (B,), NaN where nothing in it counts."""
    count = np.bincount(found.blocks, weights=found.residual != 0.0)
    squares = np.bincount(found.blocks, weights=found.residual**2)
    return np.log(np.where(count > 0.0, squares, np.nan) / np.maximum(count, 1.0))
