"""The bench of controllers, a part of ``design``: the same scenarios under each law, and what each component brings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from pneucli.closed_loop.law_comparison import (
    COMPONENTS,
    NO_COMPONENT,
    compare_laws,
    with_and_without_map,
    without_component,
)
from pneucli.closed_loop.metrics import MIN_SLIDING_SHARE, OBSERVERS, Metrics
from pneucli.closed_loop.scenarios import PRESSURE_SUFFIX, read_scenarios
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, Scenario
from pneucli.controller.laws import DEFAULT
from pneucli.controller.parameters import Controller
from pneucli.messages.law_comparison import observer_at_bound
from pneucli.pipeline.context import Context
from pneucli.recording import Recording
from pneucli.simulate.model import Model

RunsByLaw = Mapping[str, Mapping[str, tuple[Run, Metrics]]]


@dataclass(frozen=True)
class LawComparison:
    """Runs and figures of the laws, without the inverse map, of ``best`` without a component, and of variants."""

    laws: RunsByLaw = field(default_factory=dict)
    without_inverse_map: RunsByLaw = field(default_factory=dict)
    ablation: RunsByLaw = field(default_factory=dict)
    variants: RunsByLaw = field(default_factory=dict)


def closed_loop_tables(context: Context) -> list[dict[str, Any]] | None:
    """Return the pipeline's closed-loop scenarios, none for the default ones; None where it has others only."""
    tables = context.config.scenarios
    own = [{k: v for k, v in t.items() if k != "kind"} for t in tables if t.get("kind") == "closed-loop"]
    return own if own or not tables else None


def closed_loop_scenarios(context: Context, recordings: Sequence[Recording], controller: Controller) -> list[Scenario]:
    """Return the closed-loop scenarios of the pipeline, or the default ones."""
    tables = closed_loop_tables(context)
    where = f"{context.path}, key scenarios"
    return [] if tables is None else read_scenarios(tables, controller, where, recorded_references(recordings))


def recorded_references(recordings: Sequence[Recording]) -> dict[str, tuple[Any, Any]]:
    """Return what recordings asked for or did, as references: x_ref, else x; p_ref, else p1."""
    found = {}
    for r in recordings:
        for end, names in (("", ("x_ref", "x")), (PRESSURE_SUFFIX, ("p_ref", "p1"))):
            if (name := next((n for n in names if n in r), None)) is not None:
                found[r.name + end] = (r.time, np.nan_to_num(r[name], nan=0.0))
    return found


def compare_controllers(
    model: Model,
    controllers: Mapping[str, Controller],
    scenarios: Sequence[Scenario],
    setup: ClosedLoopSetup,
    variants: Mapping[str, Controller] | None = None,
) -> LawComparison:
    """Run the laws, each without the inverse map as well, ``best`` without each component, and the variants."""
    cases = with_and_without_map(controllers)
    laws = compare_laws(model, controllers, scenarios, setup)
    bare = {name: c for name, c in cases.items() if name not in controllers}
    unmapped = compare_laws(model, bare, scenarios, setup)
    own = controllers.get(DEFAULT)
    parts = {name: without_component(own, name) for name in (NO_COMPONENT, *COMPONENTS)} if own is not None else {}
    ablation = compare_laws(model, parts, scenarios, setup)
    return LawComparison(laws, unmapped, ablation, compare_laws(model, variants or {}, scenarios, setup))


def observer_warnings(found: LawComparison) -> list[str]:
    """Return a warning for each law whose disturbance observer is at its bound M_k in over 20 % of the samples."""
    warnings = []
    for name, by in found.laws.items():
        for observer in OBSERVERS:
            shares = {s: getattr(m, f"sliding_{observer}") for s, (_, m) in by.items()}
            finite = {s: share for s, share in shares.items() if not math.isnan(share)}
            if finite and (worst := min(finite, key=finite.__getitem__)) and finite[worst] < MIN_SLIDING_SHARE:
                warnings.append(observer_at_bound(name, observer, worst, 1 - finite[worst], 1 - MIN_SLIDING_SHARE))
    return warnings


def comparison_answer(found: LawComparison) -> dict[str, Any]:
    """Return the figures by controller and scenario; null where one is not shown or without bound."""
    return {
        "compare": _metrics_by_law(found.laws),
        "without_map": _metrics_by_law(found.without_inverse_map),
        "ablation": _metrics_by_law(found.ablation),
        "variants": _metrics_by_law(found.variants),
    }


def _metrics_by_law(found: RunsByLaw) -> dict[str, Any]:
    return {name: {s: metrics_answer(m) for s, (_, m) in by.items()} for name, by in found.items()}


def metrics_answer(found: Metrics) -> dict[str, float | None]:
    """Return figures as JSON has them: null where a scenario does not show one, or it is without bound."""
    return {n: v if math.isfinite(v) else None for n, v in asdict(found).items()}
