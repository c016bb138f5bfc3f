"""What is known of a remainder that no effect of the catalogue accounts for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lombscargle

from pneucli.diagnose.remainder import Remainder, Shape
from pneucli.identify.views import View
from pneucli.quantities import SIGNALS
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

PERIODIC = 0.3  # share of the squared residual that one sine must hold
TELLING = 0.05  # share that means over a variable must hold to be spoken of
FEWEST, MOST_SAMPLES = 100, 4000
RESOLVED = 0.5  # cycles over a range, by which two sines can be told apart
FEWEST_CYCLES = 2.0  # over the range; fewer cannot be told from a drift
MOST_CYCLES = 250.0
FEWEST_SAMPLES = 16  # in a cycle
BINS = int(FEWEST_SAMPLES * MOST_CYCLES)  # of the range
STEP, FINE = 0.125, 21  # cycles between two that are tried, and how many are tried about the best
REPLAYED = "only where all is simulated together: by itself each subsystem fits"
LAWS: dict[str, Callable[[Array], list[Array]]] = {
    "a constant": lambda q: [np.ones_like(q)],
    "proportional to it": lambda q: [q],
    "a constant that changes sign with it": lambda q: [np.sign(q)],
    "growing with its square, sign kept": lambda q: [q * np.abs(q)],
    "a straight line": lambda q: [np.ones_like(q), q],
    "a parabola": lambda q: [np.ones_like(q), q, q**2],
}


@dataclass(frozen=True)
class Unknown:
    """Where the unexplained stands: subsystem, channel, variable, its character and the closest simple law in words."""

    subsystem: str
    channel: str
    ratio: float
    variable: str | None
    character: str
    law: str | None


def describe(model: Model, views: Sequence[View], worst: Remainder) -> Unknown:
    """Describe a remainder of a model, such as the worst."""
    shape = next((s for s in worst.shapes if s.share > TELLING), None)
    same = [v for v in views if type(v) is worst.kind and worst.channel in v.channels]
    if not same:
        return Unknown(worst.kind.title, worst.channel, worst.ratio, None, REPLAYED, None)
    sine = _sine(model, same, worst.channel)
    if sine is not None:
        variable, period = sine
        unit = "s" if variable == "time" else "m"
        character = f"periodic over {_title(variable)}, period {period:.3g} {unit}"
        return Unknown(worst.kind.title, worst.channel, worst.ratio, variable, character, "a sine")
    if shape is None:
        return Unknown(worst.kind.title, worst.channel, worst.ratio, None, "without a shape over any signal", None)
    drifts = shape.variable == "time"
    character = "drifting over each recording" if drifts else f"a function of {_title(shape.variable)}"
    character = f"a friction {character}" if drifts and shape.against else character
    character = f"against the motion, {character}" if shape.against and not drifts else character
    return Unknown(worst.kind.title, worst.channel, worst.ratio, shape.variable, character, _law(shape))


def _title(variable: str) -> str:
    return SIGNALS[variable].title if variable in SIGNALS else variable.replace("_", " ")


def _law(shape: Shape) -> str:
    """Return the law that fits the bins' means best for its number of constants (Schwarz's criterion)."""
    scale = float(np.max(np.abs(shape.centres))) or 1.0
    scores = {}
    for words, columns in LAWS.items():
        design = np.column_stack(columns(shape.centres / scale)) / shape.errors[:, None]
        target = shape.means / shape.errors
        rest = target - design @ np.linalg.lstsq(design, target, rcond=None)[0]
        scores[words] = float(rest @ rest) + design.shape[1] * np.log(target.size)
    return min(scores, key=scores.__getitem__)


def _sine(model: Model, views: Sequence[View], channel: str) -> tuple[str, float] | None:
    """Return the variable and period of a sine that holds much of the residual in every view, else None."""
    found = []
    for variable in ("time", "x"):
        lines = [_line(view, model, channel, variable) for view in views]
        known = [line for line in lines if line is not None]
        if known and len(known) == len(views) and min(share for share, _ in known) > PERIODIC:
            periods = [period for _, period in known]
            if max(periods) < 1.3 * min(periods):
                found.append((float(np.mean([share for share, _ in known])), variable, float(np.mean(periods))))
    return max(found)[1:] if found else None


def _line(view: View, model: Model, channel: str, variable: str) -> tuple[float, float] | None:
    """Return the share of the squared residual that the strongest sine holds, and its period."""
    e = view.experiment
    if variable == "x" and "x" not in e.raw:
        return None
    residual = view.residual(model)[channel]
    seen = np.flatnonzero(residual)
    if seen.size < FEWEST:
        return None
    y, q = residual[seen] - residual[seen].mean(), (e.time if variable == "time" else e.inputs[:, at.IN_X])[seen]
    if np.ptp(q) == 0.0 or np.ptp(y) == 0.0:
        return None
    starts = e.time[e.restarts] if variable == "time" and view.replayed else np.zeros(0)
    cycles, power = _periodogram(q, y)
    able = (cycles >= FEWEST_CYCLES) & (cycles <= seen.size / FEWEST_SAMPLES) & ~_of_restarts(cycles, q, starts)
    if not able.any():
        return None
    near = cycles[able][np.argmax(power[able])] + np.linspace(-STEP, STEP, FINE)
    near = near[~_of_restarts(near, q, starts)]
    few = slice(None, None, max(seen.size // MOST_SAMPLES, 1))
    shares = lombscargle(q[few], y[few], 2 * np.pi * near / np.ptp(q), normalize=True)
    return float(np.max(shares)), float(np.ptp(q) / near[np.argmax(shares)])


def _periodogram(q: Array, y: Array) -> tuple[Array, Array]:
    """Return cycles over the range of q (n,), and how strong a sine of so many is in y (n,), up to a factor.

    Of sums over narrow bins of q: readings over x are no even samples.
    """
    place = ((q - q.min()) * (BINS / np.ptp(q))).astype(np.int64)
    sums = np.bincount(np.minimum(place, BINS - 1), weights=y, minlength=BINS)
    power = np.abs(np.fft.rfft(sums, round(BINS / STEP))[: round(MOST_CYCLES / STEP)]) ** 2
    cycles = STEP * np.arange(power.size)
    return np.asarray(cycles, dtype=np.float64), np.asarray(power, dtype=np.float64)


def _of_restarts(cycles: Array, time: Array, starts: Array) -> NDArray[np.bool_]:
    """Return which numbers of cycles over the time are those of the restarts or a multiple, as far as it resolves them.

    What grows from restart to restart has their period: it is the comparison's, not the rig's.
    """
    if starts.size < 2:
        return np.zeros(cycles.size, dtype=bool)
    each = np.ptp(time) / float(np.median(np.diff(starts)))
    away = np.abs(cycles - each * np.maximum(np.round(cycles / each), 1.0))
    return np.asarray(away < RESOLVED)
