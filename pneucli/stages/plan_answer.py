"""Parts of the answer of ``plan``: recordings, rivals, limits, refused manoeuvres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np

from pneucli.errors import InputError
from pneucli.messages.plan import by_hand_text, manoeuvre_text
from pneucli.pipeline.context import Context
from pneucli.plan.limits import Limits
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.rivals import Rival
from pneucli.plan.selection import CHANGE_OVER_TIME, Chosen, Refused
from pneucli.plan.simulation import start_of
from pneucli.simulate.model import Model

MAX_REFUSED = 30  # refused manoeuvres in an answer


class Planned(Protocol):
    """A study that has planned: its context and the limits that it kept."""

    @property
    def context(self) -> Context:
        """The run of the stage."""
        ...

    @property
    def limits(self) -> Limits:
        """The limits of the rig."""
        ...


def plan_answer(study: Planned, chosen: Sequence[Chosen], refused: Sequence[Refused]) -> dict[str, Any]:
    """Return the answer without rivals and expectations."""
    recordings = recordings_answer(chosen)
    rows = list({r["text"] + r["quantity"]: r for r in map(refused_answer, refused)}.values())
    return {
        "schema": "pneucli/plan/1",
        "pipeline": study.context.config.name,
        "first": bool(study.context.options.get("first")),
        "seconds": recordings[-1]["end"] if recordings else 0.0,
        "recordings": recordings,
        "manual": [{"recording": r["name"], "text": r["by_hand"]} for r in recordings if r["by_hand"]],
        "limits": limits_answer(study.limits),
        "refused": rows[:MAX_REFUSED],
        "refused_count": len(rows),
        "rivals": [],
        "entropy": {"before": None, "after": None, "unit": "bit"},
        "expected": [],
        "parameters": [],
        "sizes": [],
        "warnings": [],
    }


def recordings_answer(chosen: Sequence[Chosen]) -> list[dict[str, Any]]:
    """Return the planned recordings with their times in ``commands.csv``."""
    rows, begin = [], 0.0
    for number, one in enumerate(chosen, 1):
        m = one.manoeuvre
        row = manoeuvre_answer(m)
        row |= {"name": f"plan_{number}_{m.kind}", "begin": begin, "end": begin + m.duration}
        row |= {"times_noise": [float(d) for d in one.information.distance]}
        rows.append(row)
        begin += m.duration + CHANGE_OVER_TIME
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


def rival_answer(rival: Rival, best: Model) -> dict[str, Any]:
    """Return one rival."""
    own = [] if rival.effect is None or not rival.present else rival.effect.parameters
    values = {p.name: rival.model.values.get(f"{rival.effect.name}.{p.name}") for p in own if rival.effect is not None}
    return {
        "name": rival.name,
        "effect": None if rival.effect is None else rival.effect.name,
        "present": rival.present,
        "in_place_of": rival.instead_of,
        "effects": [e.name for e in rival.model.effects],
        "probability": rival.probability,
        "prior_odds": rival.prior_odds,
        "size_error": None if rival.effect is None else rival.size_error,
        "parameters": {p.name: {"value": values[p.name], "unit": p.unit} for p in own if values[p.name] is not None},
    }


def expected_rows(rivals: Sequence[Rival], found: Sequence[float]) -> list[dict[str, Any]]:
    """Return for each rival its probability before, and that of being shown if it is true."""
    return [
        {
            "effect": r.effect.name,
            "rival": r.name,
            "probability_before": r.probability if r.present or r.probability is None else 1.0 - r.probability,
            "power": float(power),
        }
        for r, power in zip(rivals, found, strict=True)
        if r.effect is not None
    ]


def limits_answer(limits: Limits) -> dict[str, Any]:
    """Return the limits, SI; None: not limited."""

    def finite(value: float | None) -> float | None:
        return None if value is None or not np.isfinite(value) else float(value)

    low, high = limits.position
    return {
        "position": [low, high] if np.isfinite(low) and np.isfinite(high) else None,
        "max_speed": finite(limits.max_speed),
        "max_pressure": finite(limits.max_pressure),
        "max_force": finite(limits.max_force),
        "max_command": finite(limits.max_command),
        "max_frequency": finite(limits.max_frequency),
        "soft_start": limits.soft_start,
        "max_air": finite(limits.max_air),
    }


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
