"""``plan``: the next experiment, from the last diagnosis or, with ``--first``, from the rig's description alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.messages.formatting import format_plain
from pneucli.messages.plan import GOOD_POWER
from pneucli.messages.progress import counted
from pneucli.pipeline.context import Context
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.manoeuvres import candidate_manoeuvres, cost_of, draw_programme, manual_manoeuvres
from pneucli.plan.power import Prediction, power_table
from pneucli.stages.expected_power import (
    Basis,
    described_rig,
    diagnosed_pipeline,
    expected_answer,
    limits_too_narrow,
    plan_answer,
)
from pneucli.stages.plan_files import write_plan

Array = NDArray[np.float64]
DEFAULT_MINUTES, FIRST_MINUTES = 3.0, 5.0
MIN_SECONDS = 15.0  # s of machine time: one recording and one that is held out
MAX_SHARE_BY_HAND = 0.5  # of the machine time
SEED_DIGITS = 8  # of the digest


def run(context: Context) -> dict[str, Any]:
    """Plan the next experiment, write its files, and return the answer that ``--json`` prints.

    Raises InputError where the limits leave no manoeuvre, or an effect is unknown.
    """
    first = bool(context.options.get("first"))
    seconds = 60.0 * float(context.options.get("minutes", FIRST_MINUTES if first else DEFAULT_MINUTES))
    if seconds < MIN_SECONDS:
        raise InputError(
            "--minutes", f"{format_plain(seconds / 60.0)}", f"at least {format_plain(MIN_SECONDS / 60.0)}", code="E001"
        )
    basis = described_rig(context) if first else diagnosed_pipeline(context)
    context.progress("drawing a programme")
    programme = _drawn(basis, seconds)
    if not programme and not basis.safety.refused:
        raise InputError("--minutes", f"{format_plain(seconds / 60.0)}", "time for the shortest manoeuvre", code="E001")
    if not programme:
        raise limits_too_narrow(f"{context.path}, key plan")
    predictions = _predictions(context, basis, programme)
    if by_hand := _needed_by_hand(basis, _total_information(programme, predictions), seconds):
        programme = _drawn(basis, seconds, by_hand)
        predictions = _predictions(context, basis, programme)
    information = _total_information(programme, predictions)
    context.progress("power of the plan")
    powers = power_table(basis.expectation, information)
    answer = plan_answer(context, basis, programme, predictions)
    answer["expected"] = expected_answer(basis, powers, information)
    return write_plan(answer, programme, predictions, powers, context, basis)


def _drawn(basis: Basis, seconds: float, by_hand: Sequence[Manoeuvre] = ()) -> list[Manoeuvre]:
    listed = [m for bench in basis.benches for m in candidate_manoeuvres(bench, basis.limits)]
    seed = int(basis.digest[:SEED_DIGITS], 16)
    return draw_programme(listed, seconds, basis.safety, seed, by_hand)


def _predictions(context: Context, basis: Basis, programme: Sequence[Manoeuvre]) -> list[Prediction]:
    """Return each recording as the best model predicts it."""
    shown, found = [rival.effect for rival in basis.shown_rivals], []
    for number, one in enumerate(programme):
        context.progress(counted(f"simulating {one.kind}", number, len(programme)))
        found.append(basis.expectation.predict(one, shown))
    return found


def _total_information(programme: Sequence[Manoeuvre], predictions: Sequence[Prediction]) -> Array:
    """Return the information of all fitted recordings."""
    return np.asarray(sum(p.information for one, p in zip(programme, predictions, strict=True) if one.use == "train"))


def _needed_by_hand(basis: Basis, information: Array, seconds: float) -> list[Manoeuvre]:
    """Return the manoeuvres by hand that show a rival which the drawn commands would not show.

    An example is a weight on the piston: a motion alone shows a mass only relative to the scale of the pressures.
    """
    power = basis.expectation.power
    weak = [r for r in basis.shown_rivals if power(information, r.effect) < GOOD_POWER]
    listed = [m for bench in basis.benches for m in manual_manoeuvres(bench, basis.limits)] if weak else []
    groups: dict[tuple[object, ...], list[Manoeuvre]] = {}
    for one in filter(basis.safety, listed):
        groups.setdefault((*one.bench.setup, one.kind), []).append(one)
    needed: list[Manoeuvre] = []
    for group in groups.values():
        more = information + sum(basis.expectation.predict(one).information for one in group)
        fits = sum(map(cost_of, [*needed, *group])) <= MAX_SHARE_BY_HAND * seconds
        if fits and any(power(more, r.effect) >= GOOD_POWER for r in weak):
            needed += group
    return needed
