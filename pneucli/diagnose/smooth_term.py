"""Laws of one signal: how much of what is left over a smooth function of a signal explains.

What a model lacks may be a force, a friction or a flow without a name in any catalogue, and yet a function of one
signal: of the position, of time, of a pressure. Each such law is fitted to what a channel leaves over as a penalised
spline (Eilers and Marx, Statistical Science 11, 1996), beside the parameters that the model has, and to first order.
It counts by what it explains of recordings that were left out, one after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve

from pneucli.compare.error_regions import locator_signals
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.residuals import ResidualModel
from pneucli.identify.residuals.base import DiscrepancyTerm

Array = NDArray[np.float64]
Folds = Sequence[Array]

KNOTS = 60  # of a spline, evenly over the range of its signal
PENALTIES = (1e-5, 1e-3, 1e-1, 1e1, 1e3)  # penalties of its second differences that are tried, over the mean curvature
RIDGE = 1e-6  # the same of its coefficients, which holds those that no sample has
MAX_SAMPLES = 8000  # samples of a channel
SINGLE_RECORDING_FOLDS = 4  # of the only recording, left out one after the other
MIN_SIMPLE_SHARE = 0.95  # of what a spline explains: a simple course that explains as much says it all
EXCLUDED_SIGNAL = "a"  # the accelerometer's noise is in the force too

SIMPLE_SHAPES: dict[str, Callable[[Array], Array]] = {
    "a constant": lambda q: np.array([np.ones_like(q)]),
    "proportional to it": lambda q: np.array([q]),
    "a constant that changes sign with it": lambda q: np.array([np.sign(q)]),
    "growing with its square, sign kept": lambda q: np.array([q * np.abs(q)]),
    "a straight line": lambda q: np.array([np.ones_like(q), q]),
    "a parabola": lambda q: np.array([np.ones_like(q), q, q**2]),
}
_SECOND_DIFFERENCES = np.diff(np.eye(KNOTS), 2, axis=0)


@dataclass(frozen=True)
class SmoothTerm:
    """A function of one signal in one channel.

    ``acts_as`` says as what it acts (:class:`pneucli.identify.residuals.base.Way`), ``share`` how much it explains of the
    squares that were left out; ``values`` (KNOTS,) are what it is, in ``unit``, from the ``low`` to the ``high`` of the
    signal. It is a spline, held by the penalty ``penalty``, or has one of the SIMPLE courses. ``term_index`` tells ways
    apart.
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
        """What it is made of: values at the knots (k, KNOTS)."""
        if self.simple_shape is None:
            return np.eye(KNOTS)
        return SIMPLE_SHAPES[self.simple_shape](
            np.linspace(self.low, self.high, KNOTS) / max(abs(self.low), abs(self.high))
        )


class SplineRegression:
    """One channel of one kind of view: what laws of every signal make of its residuals, whichever fit leaves them.

    To first order, so that what a model has of flows serves for others that are near to it.
    """

    def __init__(self, fit: Fit, views: Sequence[ResidualModel], kind: type[ResidualModel], name: str) -> None:
        """Take the views that have such a channel, out of those to which ``fit`` was made."""
        edges = np.cumsum([0, *(v.experiment.time.size for v in views for _ in v.channels)])
        every = [(i, v, c) for i, v in enumerate(views) for c in v.channels]
        mine = [(edges[row], *one) for row, one in enumerate(every) if type(one[1]) is kind and one[2] == name]
        self._model, self._name = fit.model, name
        self._views = [view for _, _, view, _ in mine]
        self._errors = [fit.initial_state_sensitivities[i] for _, i, _, _ in mine]
        step = max(sum(v.experiment.time.size for v in self._views) // MAX_SAMPLES, 1)
        self._kept = [np.arange(0, v.experiment.time.size, step) for v in self._views]
        self._rows = [first + kept for (first, _, _, _), kept in zip(mine, self._kept, strict=True)]

    def ranked_terms(self, fit: Fit) -> list[SmoothTerm]:
        """Return laws of what a fit leaves over, first the one that explains most of what is left out."""
        left, own = self._of(fit)
        laws = [_fit_smooth_term(column, left, own) for column in self._columns]
        return sorted((law for law in laws if law is not None), key=lambda law: -law.share)

    def simplest_shape(self, fit: Fit, law: SmoothTerm) -> str | None:
        """Return the simplest course that explains about as much as a law, in words; None where none does."""
        return next(
            (one.simple_shape for one in self.simple_terms(fit, law) if one.share > MIN_SIMPLE_SHARE * law.share), None
        )

    def simple_terms(self, fit: Fit, law: SmoothTerm) -> Iterator[SmoothTerm]:
        """Yield the laws of simple courses that act as another law does, over the same signal."""
        left, own = self._of(fit)
        for course in SIMPLE_SHAPES:
            one = replace(law, simple_shape=course)
            share, values = _NormalEquations(self._rows_of(one), left, own).explained(one)
            yield replace(one, share=share, values=values @ one.basis)

    def block_costs(self, fit: Fit) -> Array:
        """Return the squares of what a fit leaves over, by block of time."""
        return self._by_block(fit, self._of(fit)[0])

    def residual_count(self, fit: Fit) -> int:
        """Return how many of them there are."""
        return sum(int(np.count_nonzero(fit.residual[rows])) for rows in self._rows)

    def held_out_costs(self, fit: Fit, law: SmoothTerm) -> Array:
        """Return the same of what a law leaves beside that of each recording, found without it."""
        sums = _NormalEquations(self._rows_of(law), *self._of(fit))
        _, moved, apart = sums.solved(law)
        parts = zip(sums.each, apart, strict=True)
        return self._by_block(fit, [np.where(r == 0.0, 0.0, r - mine @ x - moved @ j) for (x, r, j), mine in parts])

    def cost_after_adjustment(self, fit: Fit) -> float:
        """Return the squares of what a fit leaves where its own parameters adjust, to first order."""
        return _adjusted_cost(*self._of(fit))

    def unrepresented_share(self, fit: Fit, law: SmoothTerm, change: Array) -> float:
        """Return the part of the squares of a change of all residuals (N,) that a law cannot be, beside a fit's own."""
        read, own = self._of(fit)
        left = self._folds([np.where(fit.residual[r] == 0.0, 0.0, change[r]) for r in self._rows])
        sums = _NormalEquations(self._rows_of(law), left, own, read)
        values, moved, _ = sums.solved(law)
        lacking = sum(float(np.sum((r - values @ x - moved @ j) ** 2)) for x, r, j in sums.each)
        return lacking / max(_adjusted_cost(left, own), 1e-300)

    def _by_block(self, fit: Fit, left: Folds) -> Array:
        blocks = np.concatenate([fit.blocks[r] for r in self._rows])
        costs = np.bincount(np.unique(blocks, return_inverse=True)[1], np.concatenate(left) ** 2)
        return costs.astype(np.float64)

    def _rows_of(self, law: SmoothTerm) -> list[Array]:
        """Return by fold what a unit of each part of a law makes of the residuals (k, n)."""
        folds = next(c.folds for c in self._columns if (c.signal, c.number) == (law.signal, law.term_index))
        return [law.basis @ rows for rows in folds]

    def _of(self, fit: Fit) -> tuple[list[Array], list[Array]]:
        """Return by fold what a fit leaves over in this channel, and its derivatives."""
        left, own = [fit.residual[r] for r in self._rows], [fit.jacobian[r].T for r in self._rows]
        return self._folds(left), _scaled(self._folds(own))

    def _folds(self, rows: Sequence[Array]) -> list[Array]:
        """Return what is left out together: the rows (..., n) of a recording, or a quarter of the only one."""
        return list(rows) if len(rows) != 1 else np.array_split(rows[0], SINGLE_RECORDING_FOLDS, axis=-1)

    @cached_property
    def _columns(self) -> list[_TermDesign]:
        return list(self._made())

    def _made(self) -> Iterator[_TermDesign]:
        """Yield what each law of each signal is made of."""
        seen = [locator_signals(view.experiment) for view in self._views]
        lacking = [view.discrepancy_terms(self._model, self._name) for view in self._views]
        for signal in [name for name in seen[0] if all(name in s for s in seen) and name != EXCLUDED_SIGNAL]:
            values = [s[signal] - (s[signal][0] if signal == "time" else 0.0) for s in seen]
            known = np.concatenate(values)
            known = known[np.isfinite(known)]
            if not known.size or not np.ptp(known) > 0.0:
                continue
            low, high = float(known.min()), float(known.max())
            knots = [linear_bspline_basis((v - low) / (high - low)) for v in values]
            for number, ways in enumerate(zip(*lacking, strict=True)):
                if ways[0].argument in (None, signal):
                    at = [
                        k if w.modelled is None else linear_bspline_basis((w.modelled - low) / (high - low))
                        for k, w in zip(knots, ways, strict=True)
                    ]
                    made = [self._kept_of(i, way.to_residual(at[i] * way.unit_signal)) for i, way in enumerate(ways)]
                    yield _TermDesign(signal, ways[0], number, low, high, self._folds(made))

    def _kept_of(self, i: int, becomes: Array) -> Array:
        """Return of what becomes of a view's residuals (k, n) that of those which are kept there (k, m)."""
        settled = self._views[i].apply_whitening({self._name: becomes}, self._errors[i])
        kept = np.nan_to_num(settled[self._name][:, self._kept[i]], posinf=0.0, neginf=0.0)  # of a model that runs away
        return kept.astype(np.float32)  # some 30 of these are held


@dataclass(frozen=True)
class _TermDesign:
    """One signal and a way in which it may act; by fold what a unit at each knot makes of the residuals (KNOTS, n)."""

    signal: str
    way: DiscrepancyTerm
    number: int
    low: float
    high: float
    folds: Folds


def linear_bspline_basis(place: Array) -> Array:
    """Return linear B-splines (KNOTS, n) at places (n,) from 0 to 1; nothing where a place is not known."""
    out = np.zeros((KNOTS, place.size))
    known = np.flatnonzero(np.isfinite(place))
    knots = np.clip(place[known], 0.0, 1.0) * (KNOTS - 1)
    first = np.minimum(knots.astype(np.int64), KNOTS - 2)
    out[first, known], out[first + 1, known] = 1.0 - (knots - first), knots - first
    return out


def _fit_smooth_term(column: _TermDesign, left: Folds, own: Folds) -> SmoothTerm | None:
    """Return the spline of the smoothness that explains most of what is left out; None where it acts on nothing."""
    sums = _NormalEquations(column.folds, left, own)
    if not np.any(sum(sums.xx)):
        return None
    way, none = column.way, np.zeros(KNOTS)
    each = [
        SmoothTerm(column.signal, way.name, way.unit, column.number, 0.0, column.low, column.high, none, smooth)
        for smooth in PENALTIES
    ]
    (share, values), law = max(((sums.explained(one), one) for one in each), key=lambda pair: pair[0][0])
    return replace(law, share=share, values=values)


class _NormalEquations:
    """Normal equations of coefficients (k,) of rows (k, n), beside those of a fit's own parameters, by fold."""

    def __init__(self, rows: Folds, left: Folds, own: Folds, read: Folds | None = None) -> None:
        read = left if read is None else read  # 0 where nothing was
        rows = [np.where(r == 0.0, 0.0, x.astype(np.float64)) for x, r in zip(rows, read, strict=True)]
        self.each = list(zip(rows, left, own, strict=True))
        self.total = [float(r @ r) for r in left]
        self.xx, self.xr = [x @ x.T for x in rows], [x @ r for x, r, _ in self.each]
        self.xj, self.jr = [x @ j.T for x, _, j in self.each], [j @ r for _, r, j in self.each]
        self.jj = [j @ j.T for j in own]

    def _stiff(self, law: SmoothTerm) -> Array:
        """Return the penalty (k, k) of a law's parts: of a spline its second differences, by the squares' curvature."""
        curvature = np.diag(sum(self.xx))
        if law.simple_shape is not None:
            return np.asarray(RIDGE * np.diag(curvature + RIDGE))
        mean = float(np.mean(curvature)) or 1.0  # of a law that acts on nothing that was read
        return np.asarray(mean * (law.penalty * _SECOND_DIFFERENCES.T @ _SECOND_DIFFERENCES + RIDGE * np.eye(KNOTS)))

    def explained(self, law: SmoothTerm) -> tuple[float, Array]:
        """Return the share of the squares that is explained of folds left out, and the coefficients of all."""
        values, moved, apart = self.solved(law)
        gain = 0.0
        for mine, x_x, x_j, x_r, j_j, j_r in zip(apart, self.xx, self.xj, self.xr, self.jj, self.jr, strict=True):
            gain += (
                2.0 * (mine @ x_r + moved @ j_r) - mine @ x_x @ mine - moved @ j_j @ moved - 2.0 * mine @ x_j @ moved
            )
        return gain / max(sum(self.total), 1e-300), values

    def solved(self, law: SmoothTerm) -> tuple[Array, Array, list[Array]]:
        """Return the coefficients of all folds, the fit's own parameters beside them, and those without each fold.

        These are held by the law's penalty. The fit's own parameters are as they are beside all of it: a fold alone may
        be all that tells of one of them.
        """
        xx, xj, xr = np.sum(self.xx, axis=0) + self._stiff(law), np.sum(self.xj, axis=0), np.sum(self.xr, axis=0)
        jj, jr = np.sum(self.jj, axis=0), np.sum(self.jr, axis=0)
        jj = jj + RIDGE * np.eye(jr.size)
        through = np.linalg.solve(jj, np.column_stack([xj.T, jr]))
        values = np.linalg.solve(xx - xj @ through[:, :-1], xr - xj @ through[:, -1])
        moved = through[:, -1] - through[:, :-1] @ values
        parts = zip(self.xx, self.xj, self.xr, strict=True)
        apart = [solve(xx - x_x, xr - x_r - (xj - x_j) @ moved, assume_a="pos") for x_x, x_j, x_r in parts]
        return values, moved, apart


def _adjusted_cost(left: Folds, own: Folds) -> float:
    """Return the squares that are left of all folds beside a fit's own derivatives."""
    jj, jr = sum(j @ j.T for j in own), np.asarray(sum(j @ r for j, r in zip(own, left, strict=True)))
    explained = float(jr @ np.linalg.solve(jj + RIDGE * np.eye(jr.size), jr))
    return sum(float(r @ r) for r in left) - explained


def _scaled(rows: Sequence[Array]) -> list[Array]:
    """Return derivatives (k, n) by fold, each of length 1 over all, without those that do not act here."""
    size = np.sqrt(sum(np.sum(r * r, axis=1) for r in rows))
    acts = size > 0.0
    return [r[acts] / size[acts, None] for r in rows]
