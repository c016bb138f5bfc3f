"""The pressures, simulated with the measured motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from pneucli.identify.flow import flow_errors
from pneucli.identify.restarts import carried, start_errors, volume, whitened
from pneucli.identify.views.view import Array, View, difference
from pneucli.physics.declaration import Side
from pneucli.simulate.model import Model
from pneucli.simulate.run import simulate


@dataclass(frozen=True)
class Chambers(View):
    """Gas and valve.

    ``whitened`` for the errors of the starts: right for costs that are compared. Where the model is wrong, the sum of
    squares itself is the better guide, since it is the error that the user sees.
    """

    whitened: bool = False
    title: ClassVar[str] = "gas, valve and their sensors"
    sides: ClassVar[frozenset[Side]] = frozenset({"gas", "pressure sensor"})
    base: ClassVar[frozenset[str]] = frozenset({"rig", "valve"})

    @property
    def candidates(self) -> tuple[str, ...]:
        """Pressures, the gas's temperature, and the flow through the valve."""
        return ("p1", "p2", "temperature", "flow")

    def residual(self, model: Model, errors: Mapping[str, Array] | None = None) -> dict[str, Array]:
        """Return measured minus model by channel, whitened for the ``errors`` of the starts."""
        modelled = simulate(model, self.experiment)
        residual = {c: difference(self.measured[c], modelled[c], self.noise[c]) for c in self.channels}
        return self.settled(residual, self.carried(model) if errors is None else errors)

    def carried(self, model: Model) -> dict[str, Array]:
        """Return what errors of the starts become, in units of noise (:mod:`pneucli.identify.restarts`)."""
        return carried(model, self.experiment, self._start_errors) if self.whitened else {}

    def flow_errors(self, model: Model) -> dict[str, Array]:
        """Return what relative errors of the flow become, in units of noise (:mod:`pneucli.identify.flow`)."""
        return flow_errors(model, self.experiment)

    def settled(self, residual: Mapping[str, Array], errors: Mapping[str, Array]) -> dict[str, Array]:
        """Return residuals whitened for such errors."""
        starts = self.experiment.restarts
        return {c: whitened(r, errors[c], starts) if c in errors else r for c, r in residual.items()}

    def volume(self, errors: Mapping[str, Array]) -> Array:
        """Return what a likelihood adds to the squares of the residuals for such errors, channel after channel (N,)."""
        starts, none = self.experiment.restarts, np.zeros(self.experiment.time.size)
        return np.concatenate([volume(errors[c], starts) if c in errors else none for c in self.channels])

    @cached_property
    def _start_errors(self) -> dict[str, tuple[float, float]]:
        return start_errors(self.experiment)
