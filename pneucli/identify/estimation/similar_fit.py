"""Derivatives of a fit as the start of another one with a similar model."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from pneucli.arrays import Array
from pneucli.identify.estimation.blocks import copy_nonzero, residual_slices
from pneucli.identify.estimation.fit import Fit, Start
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate.model import parameter_value


@dataclass(frozen=True)
class Similar:
    """A fit of a similar model to more residual models, whose derivatives a fit may start from."""

    fitted: Fit
    residual_models: Sequence[ResidualModel]

    def start(
        self, free: Sequence[FreeParameter], residual_models: Sequence[ResidualModel], own: Collection[str] = ()
    ) -> Start:
        """Return the derivatives in the coordinates of free parameters; those by others, and by ``own``, are missing.

        The coordinate of a parameter is its distance from the null at the start, which a fit changes.
        """
        places = {id(one): i for i, one in enumerate(self.residual_models)}
        chosen = [places[id(one)] for one in residual_models]
        all_rows, rows = residual_slices(self.residual_models), residual_slices(residual_models)
        columns = {f.name: j for j, f in enumerate(self.fitted.free)}

        def write(out: Array) -> None:
            for target, f in zip(out.T, free, strict=True):
                if f.name in columns and f.name not in own:
                    j, value = columns[f.name], parameter_value(self.fitted.model, f.name)
                    factor = f.derivative(value) / self.fitted.free[j].derivative(value)
                    copy_nonzero(self.fitted.jacobian[:, j], [all_rows[i] for i in chosen], target, rows, factor)

        missing = tuple(j for j, f in enumerate(free) if f.name not in columns or f.name in own)
        return Start(write, [self.fitted.initial_state_sensitivities[i] for i in chosen], is_exact=False, own=missing)
