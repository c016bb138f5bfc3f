"""The model's own valve as the trend of the observation: its gradient, and how it moves with the model's parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.physics.declaration import PORTS
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, ValveForm, with_parameters
from pneucli.simulate.quasi_static_gradient import QuasiStaticGradient
from pneucli.simulate.run import simulate

Array = NDArray[np.float64]

DIFFERENCE_STEP = 1e-3  # of a coordinate, for differences
PRIOR_WIDENING = 3.0  # times its standard error: so far the curves alone may move a parameter away from the model's
MIN_COORDINATE_ERROR = 1e-3  # of a coordinate, by which they may at any rate


@dataclass(frozen=True)
class ModelGradient:
    """The quasi-static gradient of a fitted model over those of its parameters that show in the tests.

    ``start`` (k,) and ``covariance`` (k, k) are the model's, in the coordinates of the fit.
    """

    model: Model
    reference_test: Experiment
    free: tuple[FreeParameter, ...]
    start: Array
    covariance: Array

    @property
    def valve(self) -> ValveForm:
        """The paths that fill and vent the vessel."""
        return self.model.valve_of_chamber(self.reference_test.recording.chamber)

    @property
    def prior_whitening(self) -> Array:
        """What makes units of the prior of moves away from the model (k, k).

        The prior is wide against the model's own errors: it was fitted to these curves too, and they must not count
        twice. What neither tells, such as the area between two commands, stays as smooth as the model has it.
        """
        return whitening_matrix(
            _limited_covariance(PRIOR_WIDENING**2 * self.covariance, self.bounds), MIN_COORDINATE_ERROR
        )

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the coordinates."""
        lower, upper = ([f.to_coordinate(getattr(f, end)) for f in self.free] for end in ("lower", "upper"))
        return np.array(lower), np.array(upper)

    def at_coordinates(self, z: Array) -> QuasiStaticGradient:
        """Return the gradient at coordinates z (k,)."""
        values = {f.name: f.from_coordinate(c) for f, c in zip(self.free, z, strict=True)}
        return QuasiStaticGradient(with_parameters(self.model, values), self.reference_test)

    def memory_gradient(self, test: Experiment) -> Array:
        """Return what the model's memory adds to dp/dt in a test, and its derivatives, shape ``(1 + k, n)`` in Pa/s.

        Without memory there are none, ``(1, n)``.
        """
        if not has_memory(self.model):
            return np.zeros((1, test.time.size))
        now = memory_gradient(self.model, test)
        moved = [
            memory_gradient(self.at_coordinates(self.start + step).model, test)
            for step in DIFFERENCE_STEP * np.eye(self.start.size)
        ]
        return np.array([now, *((other - now) / DIFFERENCE_STEP for other in moved)])

    def sensitivity(self, z: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return the derivatives to the coordinates, shape ``u.shape + (k,)``, by differences to both sides."""
        out = np.empty((*u.shape, z.size))
        for j, row in enumerate(DIFFERENCE_STEP * np.eye(z.size)):
            ahead, behind = (self.at_coordinates(z + step)(u, p, supply) for step in (row, -row))
            out[..., j] = (ahead - behind) / (2 * DIFFERENCE_STEP)
        return out

    def standard_error(self, u: Array, p: Array, supply: Array) -> Array:
        """Return the standard error in Pa/s that the model's own parameters leave, shape of u."""
        rows = self.sensitivity(self.start, u, p, supply)
        return np.asarray(np.sqrt(np.maximum(np.einsum("...i,ij,...j->...", rows, self.covariance, rows), 0.0)))


def model_gradient_of(found: Fit, tests: Sequence[Experiment], *, with_memory: bool = True) -> ModelGradient:
    """Return the trend of a fitted model with those of its parameters that show in the tests.

    Those that show in its memory alone are left out unless it is taken ``with_memory``. Raises InputError where the
    model's valve never opens.
    """
    if not found.model.valve_of_chamber(tests[0].recording.chamber).commands:
        nothing = "at no command does air flow the way it should, so the model's valve never opens"
        mend = "turn the sign of u, or see what pneucli ingest finds implausible"
        raise InputError("valve tests", nothing, "u above the null command fills, u below it vents", mend)
    here = np.array([f.to_coordinate(e.value) for f, e in zip(found.free, found.estimates, strict=True)])
    whole = ModelGradient(found.model, tests[0], found.free, here, found.covariance)
    felt = np.zeros(here.size, dtype=bool)
    for test in tests:
        u, p, supply = test.inputs[:, (at.IN_U, at.IN_P1, at.IN_SUPPLY)].T
        u = np.abs(u).max() * np.linspace(-1.0, 1.0, u.size)  # between the commands too
        felt |= np.any(whole.sensitivity(here, u, p, supply) != 0.0, axis=0)
        if with_memory:
            moved = whole.memory_gradient(test)[1:]
            felt[: len(moved)] |= np.any(moved != 0.0, axis=1)
    free = tuple(f for f, mine in zip(found.free, felt, strict=True) if mine)
    trend = ModelGradient(found.model, tests[0], free, here[felt], found.covariance[np.ix_(felt, felt)])
    return replace(trend, covariance=_limited_covariance(trend.covariance, trend.bounds))


def whitening_matrix(covariance: Array, min_error: float) -> Array:
    """Return the matrix (k, k) that turns errors of this covariance into independent ones of size 1.

    None is taken to be smaller than ``min_error``, so that there always is one.
    """
    variance, axes = np.linalg.eigh(np.nan_to_num(0.5 * (covariance + covariance.T)))
    return np.asarray(axes.T / np.sqrt(np.maximum(variance, min_error**2))[:, None])


def _limited_covariance(covariance: Array, bounds: tuple[Array, Array]) -> Array:
    """Return a covariance (k, k) with no parameter less certain than one that may be anything between its bounds."""
    error = np.sqrt(np.diag(covariance))
    widest = (bounds[1] - bounds[0]) / np.sqrt(12.0)
    share = np.minimum(1.0, widest / np.maximum(error, 1e-300))
    return np.asarray(covariance * np.outer(share, share))


def has_memory(model: Model) -> bool:
    """Whether what an effect does depends on what went before."""
    return any(PORTS[port].has_memory for effect in model.effects for port in effect.ports)


def memory_gradient(model: Model, test: Experiment) -> Array:
    """Return what effects with a memory add to dp/dt of the valve at rest, in Pa/s, shape of the test's time.

    Heat that is exchanged, a spool that follows, a supply that gives way: what the model shows in this very test
    beside its quasi-static gradient. What is measured less that does not depend on what went before.
    """
    still, p = QuasiStaticGradient(model, test), simulate(model, test)["p1"]
    u, supply, steps = test.inputs[:-1, at.IN_U], test.inputs[:-1, at.IN_SUPPLY], np.diff(test.time)
    rate = np.diff(p) / steps - 0.5 * (still(u, p[:-1], supply) + still(u, p[1:], supply))
    last = np.arange(steps.size)
    last[test.restarts[test.restarts > 0] - 1] -= 1  # what a restart mends is no gradient
    rate = rate[np.maximum(last, 0)]
    return np.append(rate, rate[-1])
