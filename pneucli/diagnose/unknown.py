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
MOST_SAMPLES = 4000
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
    """Describe the worst remainder of a model."""
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
    q = e.time if variable == "time" else e.inputs[:, at.IN_X]
    seen = np.flatnonzero(residual)[:: max(np.count_nonzero(residual) // MOST_SAMPLES, 1)]
    if seen.size < 100 or np.ptp(q[seen]) == 0.0:
        return None
    y, q = residual[seen] - residual[seen].mean(), q[seen]
    cycles = np.linspace(2.0, 40.0, 300)  # over the range; fewer cannot be told from a drift
    power = lombscargle(q, y, 2 * np.pi * cycles / np.ptp(q), normalize=True)
    best = int(np.argmax(power))
    return float(power[best]), float(np.ptp(q) / cycles[best])
