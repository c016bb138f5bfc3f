"""Parts of the answer of ``plan``: recordings, rivals, limits, refused manoeuvres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.messages.plan import by_hand_text, manoeuvre_text
from pneucli.pipeline.context import Context
from pneucli.plan.limits import Limits
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.power import Power, Prediction
from pneucli.plan.programme import cost_of
from pneucli.plan.safety import BEST_MODEL, Refused
from pneucli.plan.simulation import start_of
from pneucli.stages.plan_basis import Basis

Array = NDArray[np.float64]

MAX_REFUSED = 30  # refused manoeuvres in an answer


def plan_answer(
    context: Context, basis: Basis, programme: Sequence[Manoeuvre], predictions: Sequence[Prediction]
) -> dict[str, Any]:
    """Return the answer without expectations."""
    recordings = recordings_answer(programme)
    for row, predicted in zip(recordings, predictions, strict=True):
        row["times_noise"] = {name: one.rms for name, one in predicted.differences.items()}
    rows = list({r["text"] + r["quantity"]: r for r in map(refused_answer, basis.safety.refused)}.values())
    first = bool(context.options.get("first"))
    best = {"name": BEST_MODEL, "effect": None, "present": True, "probability": None, "in_place_of": None}
    return {
        "schema": "pneucli/plan/1",
        "pipeline": context.config.name,
        "first": first,
        "seconds": recordings[-1]["end"],
        "recordings": recordings,
        "manual": [{"recording": r["name"], "text": r["by_hand"]} for r in recordings if r["by_hand"]],
        "limits": limits_answer(basis.limits),
        "refused": rows[:MAX_REFUSED],
        "refused_count": len(rows),
        "rivals": [] if first else [best, *({"name": r.name} | asdict(r) for r in basis.rivals)],
        "warnings": [*basis.warnings],
    }


def recordings_answer(programme: Sequence[Manoeuvre]) -> list[dict[str, Any]]:
    """Return the planned recordings with their times in ``commands.csv``."""
    rows, begin = [], 0.0
    for number, m in enumerate(programme, 1):
        row = manoeuvre_answer(m)
        rows.append(row | {"name": f"plan_{number}_{m.kind}", "begin": begin, "end": begin + m.duration})
        begin += cost_of(m)
    return rows


def manoeuvre_answer(m: Manoeuvre) -> dict[str, Any]:
    """Return one manoeuvre."""
    bench = m.bench
    return {
        "use": m.use,
        "kind": m.kind,
        "bench": bench.name,
        "experiment": bench.experiment,
        "drive": bench.drive,
        "column": bench.quantity,
        "chamber_2": bench.template.chamber_2,
        "chamber": bench.template.chamber,
        "imposed": bench.template.imposed,
        "valve": "shut" if m.kind == "shut-valve" else None,
        "start": asdict(start_of(m)),
        "gain": bench.gain if bench.drive == "position" else None,
        "centre": m.centre,
        "level": m.level,
        "frequency": m.frequency,
        "speed": m.speed,
        "pressure": m.pressure,
        "force": m.force,
        "added_mass": m.added_mass,
        "by_hand": by_hand_text(m.kind, m.force, m.added_mass) if m.by_hand else None,
    }


def expected_answer(basis: Basis, powers: Sequence[Power], information: Array) -> list[dict[str, Any]]:
    """Return for each rival its probability before, and the power to show it; without rivals for every effect.

    A rival that no bench of the recordings can show has a power of 0.
    """
    if not basis.rivals:
        typical = [p for p in powers if p.typical]
        return [_expected(p.effect, p.effect, None, p.power) for p in typical]
    shown = {r.name: basis.expectation.power(information, r.effect) for r in basis.shown_rivals}
    return [_expected(r.effect, r.name, r.own_probability, shown.get(r.name, 0.0)) for r in basis.rivals]


def _expected(effect: str, rival: str, probability: float | None, power: float) -> dict[str, Any]:
    return {"effect": effect, "rival": rival, "probability_before": probability, "power": power}


def limits_answer(limits: Limits) -> dict[str, Any]:
    """Return the limits, SI; None: not limited."""
    values = asdict(limits) | {"position": list(limits.position)}
    return {name: value if value is not None and np.isfinite(value).all() else None for name, value in values.items()}


def refused_answer(one: Refused) -> dict[str, Any]:
    """Return a refused manoeuvre with the first limit that it exceeds."""
    first = one.violations[0]
    return {
        "text": manoeuvre_text(manoeuvre_answer(one.manoeuvre)),
        "bench": one.manoeuvre.bench.name,
        "model": one.model,
        "quantity": first.quantity,
        "value": first.value if np.isfinite(first.value) else None,
        "limit": first.limit,
        "unit": first.unit,
    }


def limits_too_narrow(where: str) -> InputError:
    """Return the refusal of a plan for which no manoeuvre is left."""
    mend = "state end_margin, max_speed, max_pressure or max_force in [plan]; pneucli plan -v shows what was refused"
    return InputError(where, "no manoeuvre keeps the limits of the rig", "wider limits", mend, code="E071")
