"""The normal equations of a smooth term, together with the parameters of the fit, by cross-validation fold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve

from pneucli.diagnose.smooth_term import KNOTS, SmoothTerm

Array = NDArray[np.float64]
Folds = Sequence[Array]

RIDGE = 1e-6  # the same of the coefficients, for those without samples
_SECOND_DIFFERENCES = np.diff(np.eye(KNOTS), 2, axis=0)


class NormalEquations:
    """The normal equations by fold of coefficients (k,) of rows (k, n), together with the fit's own parameters."""

    def __init__(self, rows: Folds, residuals: Folds, derivatives: Folds) -> None:
        # a residual of 0 does not count
        rows = [np.where(r == 0.0, 0.0, x.astype(np.float64)) for x, r in zip(rows, residuals, strict=True)]
        self.total = [float(r @ r) for r in residuals]
        self.xx, self.xr = [x @ x.T for x in rows], [x @ r for x, r in zip(rows, residuals, strict=True)]
        self.xj = [x @ j.T for x, j in zip(rows, derivatives, strict=True)]
        self.jr = [j @ r for j, r in zip(derivatives, residuals, strict=True)]
        self.jj = [j @ j.T for j in derivatives]

    def _penalty_matrix(self, smooth_term: SmoothTerm) -> Array:
        """Return the penalty (k, k): of a spline that of the second differences, times the mean curvature."""
        curvature = np.diag(sum(self.xx))
        if smooth_term.simple_shape is not None:
            return np.asarray(RIDGE * np.diag(curvature + RIDGE))
        mean = float(np.mean(curvature)) or 1.0  # of a function of which no residual depends
        return np.asarray(
            mean * (smooth_term.penalty * _SECOND_DIFFERENCES.T @ _SECOND_DIFFERENCES + RIDGE * np.eye(KNOTS))
        )

    def explained(self, smooth_term: SmoothTerm) -> tuple[float, Array]:
        """Return the share of the left-out squares that is explained, and the coefficients from all folds."""
        values, adjustment, left_out = self.solved(smooth_term)
        gain = 0.0
        for coefficients, x_x, x_j, x_r, j_j, j_r in zip(
            left_out, self.xx, self.xj, self.xr, self.jj, self.jr, strict=True
        ):
            gain += (
                2.0 * (coefficients @ x_r + adjustment @ j_r)
                - coefficients @ x_x @ coefficients
                - adjustment @ j_j @ adjustment
                - 2.0 * coefficients @ x_j @ adjustment
            )
        return gain / max(sum(self.total), 1e-300), values

    def solved(self, smooth_term: SmoothTerm) -> tuple[Array, Array, list[Array]]:
        """Return the coefficients of all folds, the adjustment of the fit's own parameters, and the coefficients
        without each fold.

        The adjustment is that of all folds, because a single fold may alone identify one of the parameters.
        """
        xx, xj, xr = (
            np.sum(self.xx, axis=0) + self._penalty_matrix(smooth_term),
            np.sum(self.xj, axis=0),
            np.sum(self.xr, axis=0),
        )
        jj, jr = np.sum(self.jj, axis=0), np.sum(self.jr, axis=0)
        jj = jj + RIDGE * np.eye(jr.size)
        elimination = np.linalg.solve(jj, np.column_stack([xj.T, jr]))
        values = np.linalg.solve(xx - xj @ elimination[:, :-1], xr - xj @ elimination[:, -1])
        adjustment = elimination[:, -1] - elimination[:, :-1] @ values
        parts = zip(self.xx, self.xj, self.xr, strict=True)
        left_out = [solve(xx - x_x, xr - x_r - (xj - x_j) @ adjustment, assume_a="pos") for x_x, x_j, x_r in parts]
        return values, adjustment, left_out


def scaled_derivatives(rows: Sequence[Array]) -> list[Array]:
    """Return derivatives (k, n) by fold, scaled to length 1 over all folds, without those that are 0."""
    size = np.sqrt(sum(np.sum(r * r, axis=1) for r in rows))
    is_active = size > 0.0
    return [r[is_active] / size[is_active, None] for r in rows]
