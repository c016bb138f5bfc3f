"""What an unknown law would explain: a smooth function of one signal, shared by all recordings.

In the balance of forces it is a force, or a friction against the motion; in the chambers a flow of gas, summed from
each restart on. An effect of the catalogue that is there explains more with its one or two numbers than any such
function; one that only resembles what acts does not (after Kennedy and O'Hagan, J. R. Stat. Soc. B 63, 2001).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.compare.where import locators
from pneucli.diagnose.likelihood import deviance
from pneucli.diagnose.trial import State
from pneucli.identify.fit import Problem
from pneucli.identify.least_squares import inverse
from pneucli.identify.parameters import value_of
from pneucli.identify.views import Chambers, Forces, View
from pneucli.physics.declaration import Effect
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model
from pneucli.simulate.run import base_vector

Array = NDArray[np.float64]
Acts = Literal["force", "friction", "flow"]

NODES = 6  # of a piecewise linear function
OVER = ("time", "x", "v", "p1", "p2", "u")
PRESSURES = ("p1", "p2")


@dataclass(frozen=True)
class Smooth:
    """One function: how it acts, over which signal, and the fall of the deviance that it brings on all readings."""

    acts: Acts
    variable: str
    gain: float


@dataclass(frozen=True)
class Left:
    """What a ``model`` leaves over in all views, with its parameters' derivatives, and the deviance of that.

    ``residual`` (N,), ``jacobian`` (N, k); the first ``fitted`` of them are of the views that were fitted.
    """

    views: Sequence[View]
    errors: Sequence[Mapping[str, Array]]
    residual: Array
    jacobian: Array
    fitted: int
    cost: float
    model: Model

    @classmethod
    def by(cls, state: State, train: Sequence[View], held_out: Sequence[View]) -> Left:
        """Return what a fitted state leaves over; the held-out views are simulated for it."""
        found, n = state.fit, state.fit.residual.size
        problem = Problem(found.model, held_out, found.free)
        z = np.array([f.inward(value_of(found.model, f.name)) for f in found.free])
        test = problem.data(found.model)
        residual = np.concatenate([found.residual, *test])
        slopes = problem.jacobian(z)[: residual.size - n] if held_out else np.zeros((0, z.size))
        views, errors = [*train, *held_out], [*found.errors, *problem.errors]
        jacobian = np.vstack([found.jacobian[:n], slopes])
        return cls(views, errors, residual, jacobian, n, state.deviance, found.model)

    def gain(self, columns: Array) -> float:
        """Return the fall of the deviance that columns (N, m) bring, fitted with all parameters beside them."""
        design = np.hstack([np.where(self.residual[:, None] != 0.0, columns, 0.0), self.jacobian])
        own = design[: self.fitted]
        # their sign does not matter: base parameters move either way
        sizes = inverse(own.T @ own) @ (own.T @ self.residual[: self.fitted])
        rest = np.where(self.residual != 0.0, self.residual - design @ sizes, 0.0)
        return self.cost - float(deviance(self.views, rest, self.errors).sum())


def strongest(left: Left, effect: Effect) -> Smooth | None:
    """Return the function that explains most in the views that feel the effect, None where no signal varies there."""
    kinds = {type(view) for view in left.views if view.feels(effect)} & {Chambers, Forces}
    found = [
        Smooth(acts, variable, left.gain(columns))
        for kind in kinds
        for acts, variable, columns in _functions(left.views, kind, left.model)
    ]
    return max(found, key=lambda s: s.gain, default=None)


def _functions(views: Sequence[View], kind: type[View], model: Model) -> Iterator[tuple[Acts, str, Array]]:
    """Yield how a function acts, over what, and what each of its parts changes in the residuals (N, m)."""
    actions: tuple[Acts, ...] = ("flow",) if kind is Chambers else ("force", "friction")
    for variable in OVER:
        values = [_values(view, variable) for view in views if type(view) is kind]
        known = np.concatenate([v for v in values if v is not None] or [np.zeros(1)])
        if np.ptp(known) == 0.0:
            continue
        low, high = np.quantile(known, (0.005, 0.995))
        nodes = np.linspace(low, high, NODES)
        for acts in actions:
            yield acts, variable, np.vstack([_columns(view, kind, variable, nodes, acts, model) for view in views])


def _values(view: View, variable: str) -> Array | None:
    """Return a signal (n,) of a view, None where it was not recorded; time begins with the recording."""
    values = locators(view.experiment).get(variable)
    return values - values[0] if values is not None and variable == "time" else values


def _columns(view: View, kind: type[View], variable: str, nodes: Array, acts: Acts, model: Model) -> Array:
    """Return what the function's parts change in one view's residuals (N, m), zeros where it does not act."""
    values, n, m = _values(view, variable), view.experiment.time.size, nodes.size
    out = np.zeros((n * len(view.channels), m * (len(PRESSURES) if acts == "flow" else 1)))
    if type(view) is not kind or values is None:
        return out
    hats = np.array([np.interp(values, nodes, row) for row in np.eye(m)]).T
    for i, channel in enumerate(view.channels):
        rows = slice(i * n, (i + 1) * n)
        if acts == "flow" and channel in PRESSURES:
            first = m * PRESSURES.index(channel)
            out[rows, first : first + m] = _filled(view, hats, channel, model) / view.noise[channel]
        elif channel == "force":
            against = np.sign(view.experiment.inputs[:, at.IN_V]) if acts == "friction" else np.ones(n)
            out[rows] = hats * against[:, None] / view.noise[channel]
    return out


def _filled(view: View, flow: Array, channel: str, model: Model) -> Array:
    """Return the pressure (n, m) that flows (n, m) build up from each restart on, gas that leaves by itself neglected.

    In units of kappa R T for 1 m^3, so that parts have sizes that can be solved for.
    """
    e = view.experiment
    base = dict(zip(at.BASE, base_vector(model, e), strict=True))
    x, stroke = e.inputs[:, at.IN_X], base["rig.stroke"]
    if channel == "p1":
        volume = base["rig.dead_volume_1"] + base["rig.piston_area_1"] * x
    else:
        volume = base["rig.dead_volume_2"] + base["rig.piston_area_2"] * (stroke - x)
    steps = flow / volume[:, None] * np.diff(e.time, prepend=e.time[0])[:, None]
    sums = np.cumsum(steps, axis=0)
    lengths = np.diff(np.append(e.restarts, e.time.size))
    return np.asarray(sums - np.repeat(sums[e.restarts], lengths, axis=0))
