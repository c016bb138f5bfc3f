"""The regression of a channel's residual on smooth functions of signals."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve

from pneucli.arrays import Array
from pneucli.compare.error_regions import locator_signals
from pneucli.identify.estimation.blocks import channel_slices
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.residuals import ResidualModel
from pneucli.identify.residuals.base import DiscrepancyTerm

Folds = Sequence[Array]
KNOTS = 60  # evenly spaced over the range of the signal
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


SIMPLE_SHAPES: dict[str, Callable[[Array], Array]] = {
    "constant": lambda q: np.array([np.ones_like(q)]),
    "proportional": lambda q: np.array([q]),
    "sign": lambda q: np.array([np.sign(q)]),
    "signed-square": lambda q: np.array([q * np.abs(q)]),
    "line": lambda q: np.array([np.ones_like(q), q]),
    "parabola": lambda q: np.array([np.ones_like(q), q, q**2]),
}


@dataclass(frozen=True)
class SmoothTerm:
    """A function of one signal in one channel.

    ``acts_as`` is the quantity as which it acts (:class:`pneucli.identify.residuals.base.DiscrepancyTerm`), ``share``
    the part of the left-out squares that it explains; ``values`` (KNOTS,) has its values in ``unit`` from ``low`` to
    ``high`` of the signal. It is a spline with the weight ``penalty``, or has one of the SIMPLE_SHAPES. ``term_index``
    is that of the discrepancy term.
    """

    signal: str
    acts_as: str
    unit: str
    term_index: int
    share: float
    low: float
    high: float
    values: Array
    penalty: float
    simple_shape: str | None = None

    @property
    def basis(self) -> Array:
        """The basis functions at the knots (k, KNOTS)."""
        if self.simple_shape is None:
            return np.eye(KNOTS)
        return SIMPLE_SHAPES[self.simple_shape](
            np.linspace(self.low, self.high, KNOTS) / max(abs(self.low), abs(self.high))
        )


PENALTIES = (1e-5, 1e-3, 1e-1, 1e1, 1e3)  # of the second differences, over the mean curvature
MAX_SAMPLES = 8000  # of a channel
FUNCTIONS_AT_ONCE = 10  # whose responses are in memory at full length
SINGLE_RECORDING_FOLDS = 4  # of a single recording
MIN_SIMPLE_SHARE = 0.95  # of the share of a spline: a simple shape with as much replaces it
EXCLUDED_SIGNAL = "a"  # the accelerometer's noise is in the force, too


class SplineRegression:
    """The regression of one channel's residuals on smooth functions of every signal.

    It is linearised, so that the flows of one model serve for others nearby.
    """

    def __init__(
        self, fit: Fit, residual_models: Sequence[ResidualModel], kind: type[ResidualModel], name: str
    ) -> None:
        """Select the residual models with the channel from those to which ``fit`` was made."""
        every = [(i, v, c) for i, v in enumerate(residual_models) for c in v.channels]
        rows = channel_slices(residual_models)
        members = [
            (r.start, *one) for r, one in zip(rows, every, strict=True) if type(one[1]) is kind and one[2] == name
        ]
        self._model, self._name = fit.model, name
        self._residual_models = [residual_model for _, _, residual_model, _ in members]
        self._errors = [fit.initial_state_sensitivities[i] for _, i, _, _ in members]
        step = max(sum(v.experiment.time.size for v in self._residual_models) // MAX_SAMPLES, 1)
        self._kept = [np.arange(0, v.experiment.time.size, step) for v in self._residual_models]
        self._rows = [first + kept for (first, _, _, _), kept in zip(members, self._kept, strict=True)]

    def ranked_terms(self, fit: Fit) -> list[SmoothTerm]:
        """Return smooth functions of a fit's residual, the largest share first."""
        residuals, derivatives = self._residuals_and_derivatives(fit)
        smooth_terms = [_fit_smooth_term(column, residuals, derivatives) for column in self._columns]
        return sorted(
            (smooth_term for smooth_term in smooth_terms if smooth_term is not None),
            key=lambda smooth_term: -smooth_term.share,
        )

    def simplest_shape(self, fit: Fit, smooth_term: SmoothTerm) -> str | None:
        """Return the first of SIMPLE_SHAPES that explains about as much as a spline; None where none does."""
        return next(
            (
                one.simple_shape
                for one in self.simple_terms(fit, smooth_term)
                if one.share > MIN_SIMPLE_SHARE * smooth_term.share
            ),
            None,
        )

    def simple_terms(self, fit: Fit, smooth_term: SmoothTerm) -> Iterator[SmoothTerm]:
        """Yield functions of simple shape of the same signal that act as a spline does."""
        residuals, derivatives = self._residuals_and_derivatives(fit)
        for shape in SIMPLE_SHAPES:
            one = replace(smooth_term, simple_shape=shape)
            share, values = NormalEquations(self._responses_of(one), residuals, derivatives).explained(one)
            yield replace(one, share=share, values=values @ one.basis)

    def _responses_of(self, smooth_term: SmoothTerm) -> list[Array]:
        """Return by fold the response of the residual to each basis function (k, n)."""
        folds = next(
            c.folds for c in self._columns if (c.signal, c.number) == (smooth_term.signal, smooth_term.term_index)
        )
        return [smooth_term.basis @ rows for rows in folds]

    def _residuals_and_derivatives(self, fit: Fit) -> tuple[list[Array], list[Array]]:
        """Return by fold a fit's residual in this channel, and its derivatives."""
        residuals, derivatives = [fit.residual[r] for r in self._rows], [fit.jacobian[r].T for r in self._rows]
        return self._folds(residuals), scaled_derivatives(self._folds(derivatives))

    def _folds(self, rows: Sequence[Array]) -> list[Array]:
        """Return the rows (..., n) by fold: by recording, or by quarter of a single recording."""
        return list(rows) if len(rows) != 1 else np.array_split(rows[0], SINGLE_RECORDING_FOLDS, axis=-1)

    @cached_property
    def _columns(self) -> list[_TermDesign]:
        return list(self._term_designs())

    def _term_designs(self) -> Iterator[_TermDesign]:
        """Yield the design of each function of each signal."""
        signals = [locator_signals(residual_model.experiment) for residual_model in self._residual_models]
        terms_by_model = [
            residual_model.discrepancy_terms(self._model, self._name) for residual_model in self._residual_models
        ]
        for signal in [name for name in signals[0] if all(name in s for s in signals) and name != EXCLUDED_SIGNAL]:
            values = [s[signal] - (s[signal][0] if signal == "time" else 0.0) for s in signals]
            finite = np.concatenate(values)
            finite = finite[np.isfinite(finite)]
            if not finite.size or not np.ptp(finite) > 0.0:
                continue
            low, high = float(finite.min()), float(finite.max())
            knots = [linear_bspline_basis((v - low) / (high - low)) for v in values]
            for number, terms in enumerate(zip(*terms_by_model, strict=True)):
                if terms[0].argument in (None, signal):
                    bases = [
                        k if w.modelled is None else linear_bspline_basis((w.modelled - low) / (high - low))
                        for k, w in zip(knots, terms, strict=True)
                    ]
                    rows_by_model = [self._thinned_responses(i, term, bases[i]) for i, term in enumerate(terms)]
                    yield _TermDesign(signal, terms[0], number, low, high, self._folds(rows_by_model))

    def _thinned_responses(self, i: int, term: DiscrepancyTerm, basis: Array) -> Array:
        """Return the whitened response of a recording to each basis function (k, m) at the samples in use."""
        out = np.empty((len(basis), self._kept[i].size), dtype="float32")  # about 30 of these are in memory
        for first in range(0, len(basis), FUNCTIONS_AT_ONCE):
            response = {self._name: term.to_residual(basis[first : first + FUNCTIONS_AT_ONCE] * term.unit_signal)}
            whitened = self._residual_models[i].apply_whitening(response, self._errors[i])[self._name]
            out[first : first + FUNCTIONS_AT_ONCE] = whitened[:, self._kept[i]]
        return np.nan_to_num(out, copy=False, posinf=0.0, neginf=0.0)  # of a diverging model


@dataclass(frozen=True)
class _TermDesign:
    """A signal and a discrepancy term; by fold the response of the residual to a unit at each knot (KNOTS, n)."""

    signal: str
    term: DiscrepancyTerm
    number: int
    low: float
    high: float
    folds: Folds


def _fit_smooth_term(column: _TermDesign, residuals: Folds, derivatives: Folds) -> SmoothTerm | None:
    """Return the spline with the penalty that explains most of the left-out squares; None where the residual is
    insensitive.
    """
    sums = NormalEquations(column.folds, residuals, derivatives)
    if not np.any(sum(sums.xx)):
        return None
    term, zeros = column.term, np.zeros(KNOTS)
    options = [
        SmoothTerm(column.signal, term.name, term.unit, column.number, 0.0, column.low, column.high, zeros, smooth)
        for smooth in PENALTIES
    ]
    (share, values), smooth_term = max(((sums.explained(one), one) for one in options), key=lambda pair: pair[0][0])
    return replace(smooth_term, share=share, values=values)


def scaled_derivatives(rows: Sequence[Array]) -> list[Array]:
    """Return derivatives (k, n) by fold, scaled to length 1 over all folds, without those that are 0."""
    size = np.sqrt(sum(np.sum(r * r, axis=1) for r in rows))
    is_active = size > 0.0
    return [r[is_active] / size[is_active, None] for r in rows]


def linear_bspline_basis(positions: Array) -> Array:
    """Return linear B-splines (KNOTS, n) at positions (n,) from 0 to 1; 0 where a position is NaN."""
    out = np.zeros((KNOTS, positions.size))
    finite = np.flatnonzero(np.isfinite(positions))
    knots = np.clip(positions[finite], 0.0, 1.0) * (KNOTS - 1)
    first = np.minimum(knots.astype(np.int64), KNOTS - 2)
    out[first, finite], out[first + 1, finite] = 1.0 - (knots - first), knots - first
    return out
