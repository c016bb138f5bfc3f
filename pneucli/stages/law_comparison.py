"""The bench of controllers, a part of ``design``: the same scenarios under each law, and what each component brings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from pneucli.closed_loop.law_comparison import COMPONENTS, WHOLE, mapped, trial, without
from pneucli.closed_loop.metrics import Metrics
from pneucli.closed_loop.scenarios import PRESSED, scenarios_from
from pneucli.closed_loop.simulation import Bench, Run, Scenario
from pneucli.controller import layout
from pneucli.controller.laws import DEFAULT
from pneucli.controller.parameters import Controller
from pneucli.io.artifacts import Provenance, write_table
from pneucli.pipeline.context import Context
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model

Trial = Mapping[str, Mapping[str, tuple[Run, Metrics]]]
KEPT = 2000  # samples of a run that are kept for pictures
SIGNALS = {"x": (at.X, "m"), "v": (at.V, "m/s"), "p1": (at.P1, "Pa"), "p2": (at.P2, "Pa")}
LOGGED = {
    "u": (layout.L_U1, "V"),
    "u2": (layout.L_U2, "V"),
    "p1_ref": (layout.L_P1_REF, "Pa"),
    "x_shaped": (layout.L_SHAPED, "m"),
    "load_estimate": (layout.L_LOAD, "N"),
    "flow_estimate": (layout.L_FLOW1, "Pa/s"),
}


@dataclass(frozen=True)
class Compared:
    """Runs and figures of the laws, of the laws without the inverse map, and of the cascade less a component each."""

    laws: Trial = field(default_factory=dict)
    unmapped: Trial = field(default_factory=dict)
    ablation: Trial = field(default_factory=dict)


def closed_loop_tables(context: Context) -> list[dict[str, Any]] | None:
    """Return the pipeline's closed-loop scenarios, none for the default ones; None where it has others only."""
    tables = context.config.scenarios
    own = [{k: v for k, v in t.items() if k != "kind"} for t in tables if t.get("kind") == "closed-loop"]
    return own if own or not tables else None


def scenarios_of(context: Context, recordings: Sequence[Recording], controller: Controller) -> list[Scenario]:
    """Return the closed-loop scenarios of the pipeline, or the default ones."""
    tables = closed_loop_tables(context)
    where = f"{context.path}, key scenarios"
    return [] if tables is None else scenarios_from(tables, controller, where, recorded(recordings))


def recorded(recordings: Sequence[Recording]) -> dict[str, tuple[Any, Any]]:
    """Return what recordings asked for or did, as references: x_ref, else x; p_ref, else p1."""
    found = {}
    for r in recordings:
        for end, names in (("", ("x_ref", "x")), (PRESSED, ("p_ref", "p1"))):
            if (name := next((n for n in names if n in r), None)) is not None:
                found[r.name + end] = (r.time, np.nan_to_num(r[name], nan=0.0))
    return found


def compared(
    model: Model, controllers: Mapping[str, Controller], scenarios: Sequence[Scenario], bench: Bench
) -> Compared:
    """Run the laws, each without the inverse map as well, and the project's own cascade less each component."""
    cases = mapped(controllers)
    laws = trial(model, controllers, scenarios, bench)
    bare = {name: c for name, c in cases.items() if name not in controllers}
    unmapped = trial(model, bare, scenarios, bench)
    own = controllers.get(DEFAULT)
    parts = {name: without(own, name) for name in (WHOLE, *COMPONENTS)} if own is not None else {}
    return Compared(laws, unmapped, trial(model, parts, scenarios, bench))


def compared_answer(found: Compared) -> dict[str, Any]:
    """Return the figures by controller and scenario; null where one is not shown or without bound."""
    return {
        "compare": _plain(found.laws),
        "without_map": _plain(found.unmapped),
        "ablation": _plain(found.ablation),
    }


def _plain(found: Trial) -> dict[str, Any]:
    return {name: {s: figures(m) for s, (_, m) in by.items()} for name, by in found.items()}


def figures(found: Metrics) -> dict[str, float | None]:
    """Return figures as JSON has them: null where a scenario does not show one, or it is without bound."""
    return {n: v if math.isfinite(v) else None for n, v in asdict(found).items()}


def write_compared(found: Compared, out: Any, provenance: Provenance) -> None:
    """Write the figures of all cases, and the signals of the laws, thinned out for pictures."""
    rows = [
        {"group": group, "controller": name, "scenario": s} | asdict(m)
        for group, cases in (("law", found.laws), ("without map", found.unmapped), ("without", found.ablation))
        for name, by in cases.items()
        for s, (_, m) in by.items()
    ]
    if not rows:
        return
    numbers = [n for n, v in rows[0].items() if isinstance(v, float)]
    texts = {n: [str(r[n]) for r in rows] for n in ("group", "controller", "scenario")}
    write_table(
        out / "comparison.parquet",
        texts | {n: np.array([r[n] for r in rows]) for n in numbers},
        units={n: unit_of(n) for n in numbers},
        schema="pneucli/design/comparison/1",
        provenance=provenance,
    )
    write_runs(
        out / "comparison_signals.parquet",
        {(name, s): r for name, by in {**found.laws, **_pressures(found.unmapped)}.items() for s, (r, _) in by.items()},
        provenance,
        "pneucli/design/comparison_signals/1",
        KEPT,
    )


def _pressures(found: Trial) -> Trial:
    """Return the runs in which a pressure is asked for: those that the map's pictures show."""
    return {name: {s: one for s, one in by.items() if one[0].scenario.pressed} for name, by in found.items()}


def write_runs(
    path: Any, runs: Mapping[tuple[str, str], Run], provenance: Provenance, schema: str, most: int | None = None
) -> None:
    """Write signals of runs by (controller, scenario), of each at most ``most`` samples."""
    texts: dict[str, list[str]] = {"scenario": [], "controller": []}
    numbers: dict[str, list[Any]] = {}
    for (name, scenario), one in runs.items():
        s, step = one.scenario, 1 if most is None else -(-one.time.size // most)
        parts = {"time": one.time, "x_ref": s.reference, "load": s.force, "p_supply": s.supply}
        if s.pressed:
            parts["x_ref"] = np.full(one.time.size, np.nan)
        parts |= {signal: one.model[:, place] for signal, (place, _) in SIGNALS.items()}
        parts |= {signal: one.log[:, place] for signal, (place, _) in LOGGED.items()}
        for signal, part in parts.items():
            numbers.setdefault(signal, []).append(part[::step])
        count = parts["time"][::step].size
        texts["scenario"] += [scenario] * count
        texts["controller"] += [name] * count
    write_table(
        path,
        {**texts, **{n: np.concatenate(parts) for n, parts in numbers.items()}},
        units={n: u for n, (_, u) in (SIGNALS | LOGGED).items()} | {"load": "N"},
        schema=schema,
        provenance=provenance,
    )


def unit_of(figure: str) -> str:
    """Return the unit that a figure's name ends in."""
    return {"um": "um", "s": "s", "hz": "Hz", "v": "V", "kg": "kg", "pa": "Pa"}.get(figure.rsplit("_", 1)[-1], "1")
