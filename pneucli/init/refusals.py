"""Part of ``init``: what no experiment can use, refused in one line that says why and what to record."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.init.file_groups import FileGroup
from pneucli.init.survey_types import Guess, Survey
from pneucli.messages.formatting import format_plain

MAX_END_SAMPLES = 3  # samples at either end of a scaled column: a sensor that rests or clips has more there
MIN_LEVELS = 50  # different numbers of a column that may be scaled
SCALED_ENDS = ((0.0, 1.0), (-1.0, 1.0), (0.0, 100.0))
ROUNDING = 1e-6  # by which an end may miss its number
Z_MEAN, Z_DEVIATION = 0.01, 0.01  # by which mean and deviation of a z-score may miss 0 and 1, rounded to digits
SENSED = ("p1", "p2", "p_supply", "x", "v", "a", "force", "flow")


def refuse_unusable(survey: Survey, guesses: Sequence[Guess]) -> None:
    """Raise InputError where numbers were scaled, or rows are a friction map that no clock orders."""
    found = {one.signal: one for one in guesses if one.signal}
    scaled = {name: text for name in SENSED if name in found and (text := _scaled(found[name]))}
    if scaled:
        names = ", ".join(f'"{found[name].column.name or found[name].column.key}"' for name in scaled)
        raise InputError(
            str(survey.path),
            f"{names} {next(iter(scaled.values()))}: scaled numbers, in no unit",
            "readings in units, such as bar, mm and V",
            "export them as they were before they were scaled",
            code="E041",
        )
    timed = "time" in found or any(one.clock is not None for one in survey.columns)
    if {"v", "force"} <= found.keys() and not timed and not found.keys() & {"x", "p1", "flow"}:
        raise InputError(
            str(survey.path),
            "rows of velocity and force without a clock: a friction map",
            "recordings over time",
            "export the runs that it was made from: time, x or v, and the force or the pressures",
            code="E041",
        )


def _scaled(one: Guess) -> str:
    """Return how the numbers of a column were scaled; empty where they were not, or where the file says their unit."""
    values = one.column.finite_values
    if one.unit_stated or np.unique(values).size < MIN_LEVELS:
        return ""
    for low, high in SCALED_ENDS:
        if abs(float(values.min()) - low) < ROUNDING and abs(float(values.max()) - high) < ROUNDING:
            at_ends = max(_count_at(values, low), _count_at(values, high))
            return f"fills exactly {format_plain(low)} to {format_plain(high)}" if at_ends <= MAX_END_SAMPLES else ""
    is_score = abs(float(values.mean())) < Z_MEAN and abs(float(values.std()) - 1.0) < Z_DEVIATION
    return "has a mean of 0 and a deviation of 1" if is_score else ""


def _count_at(values: Array, level: float) -> int:
    return int(np.count_nonzero(np.abs(values - level) < ROUNDING))


def limits_of(groups: Sequence[FileGroup]) -> Iterator[str]:
    """Yield what cannot be identified from files in which neither a pressure nor a force was recorded."""
    for kind in groups:
        if kind.steady or kind.signals.keys() & {"p1", "p2", "p_supply", "force"}:
            continue
        names = ", ".join(name for name in kind.signals if name != "time") or "no signal"
        if {"u", "x"} <= kind.signals.keys():
            yield (
                f"{kind.surveys[0].path.name}: {names} and no pressure: friction and one gain of the valve show in "
                "ratio to supply pressure x piston area, neither a map of the valve nor a leak; record p1 for those"
            )
            continue
        yield (
            f"{kind.surveys[0].path.name}: {names} and no pressure: neither the valve's map nor friction can be "
            "identified; record p1 (and p2, p_supply), or the force on the piston beside x"
        )
