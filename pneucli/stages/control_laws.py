"""The bench of controllers, a part of ``design``: the same scenarios under each law, and what each component brings."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.closed_loop.metrics import (
    COMPONENTS,
    MIN_SLIDING_SHARE,
    NO_COMPONENT,
    OBSERVERS,
    Metrics,
    compare_laws,
    with_and_without_map,
    without_component,
)
from pneucli.closed_loop.scenarios import PRESSURE_SUFFIX, read_scenarios
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, Scenario
from pneucli.controller import layout
from pneucli.controller.laws import DEFAULT
from pneucli.controller.parameters import Controller
from pneucli.design.effect_compensation import dead_times
from pneucli.design.requirements import Requirements
from pneucli.errors import InputError
from pneucli.io.artifacts import Tables
from pneucli.messages.design import Cases, observer_at_bound
from pneucli.messages.findings import tell
from pneucli.pipeline.graph import Context
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model

CONTROLLERS_FOLDER = "controllers"  # a file a law
NO_AREA = frozenset({"demand", "filling"})  # ports of effects behind which the command sets a pressure or a flow
MAX_PLOT_SAMPLES = 2000  # samples of a run that are kept for pictures
MODEL_SIGNALS = {"x": (at.X, "m"), "v": (at.V, "m/s"), "p1": (at.P1, "Pa"), "p2": (at.P2, "Pa")}
CONTROLLER_SIGNALS = {
    "u": (layout.L_U1, "V"),
    "u2": (layout.L_U2, "V"),
    "p1_ref": (layout.L_P1_REF, "Pa"),
    "x_shaped": (layout.L_X_SHAPED, "m"),
    "load_estimate": (layout.L_LOAD, "N"),
    "flow_estimate": (layout.L_FLOW1, "Pa/s"),
}
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


def valve_warnings(model: Model) -> list[str]:
    """Return what to say of a valve that has none of the areas that the laws ask for."""
    warnings = []
    if any(valve.form == "switching" for valve in model.valves):
        shorter, longer = dead_times(model)
        warnings.append(tell("switching-design", longest=longer, between=longer - shorter))
    if others := [effect.name for effect in model.effects if NO_AREA & effect.ports.keys()]:
        warnings.append(tell("no-area-design", effects=", ".join(others)))
    return warnings


def metrics_by_law(found: RunsByLaw) -> Cases:
    """Return the figures by controller and scenario; not finite where one is not shown or without bound."""
    return {name: {s: asdict(m) for s, (_, m) in by.items()} for name, by in found.items()}


def load_controller(folder: Path, name: str) -> Controller:
    """Return the controller of that name; raises InputError where the stage could not make it."""
    if not (path := folder / CONTROLLERS_FOLDER / f"{name}.json").is_file():
        made = ", ".join(sorted(one.stem for one in path.parent.iterdir()))
        raise InputError(f"controller {name}", "it could not be designed for this axis", f"one of {made}", code="E070")
    return Controller.from_json(path.read_text(encoding="utf-8"))


def selected_controller(folder: Path, answer: Mapping[str, Any]) -> Controller:
    """Return the controller that ``[design] controller`` names."""
    return load_controller(folder, answer["requirements"]["controller"])


def closed_loop_setup(answer: Mapping[str, Any]) -> ClosedLoopSetup:
    """Return the sensors and the delay that the design reckoned with."""
    return setup_from_requirements(Requirements(**answer["requirements"]))


def setup_from_requirements(wanted: Requirements) -> ClosedLoopSetup:
    """Return the sensors and the delay of a simulation with these requirements."""
    return ClosedLoopSetup(wanted.noise_x, wanted.noise_p, wanted.quantum_x, 0.0, round(wanted.delay / wanted.period))


def write_comparison(found: LawComparison, tables: Tables) -> None:
    """Write the figures of all cases, and the signals of the laws, thinned out for pictures."""
    rows = [
        (group, name, s, *astuple(m))
        for group, cases in (
            ("law", found.laws),
            ("without map", found.without_inverse_map),
            ("without", found.ablation),
            ("variant", found.variants),
        )
        for name, by in cases.items()
        for s, (_, m) in by.items()
    ]
    if not rows:
        return
    figures = figure_columns([one.name for one in fields(Metrics)])
    tables.write("comparison", f"group, controller, scenario, {figures}", rows)
    groups = (found.laws, found.without_inverse_map, found.variants)
    runs = {
        (name, s): one
        for group in groups
        for name, by in group.items()
        for s, (one, _) in by.items()  # of those without the map, pictures show those in which a pressure is asked for
        if group is not found.without_inverse_map or one.scenario.controls_pressure
    }
    write_runs(tables, "comparison_signals", runs, MAX_PLOT_SAMPLES)


def write_runs(tables: Tables, name: str, runs: Mapping[tuple[str, str], Run], max_samples: int | None = None) -> None:
    """Write signals of runs by (controller, scenario), of each at most ``max_samples`` samples."""
    of_model, of_controller = ([place for place, _ in some.values()] for some in (MODEL_SIGNALS, CONTROLLER_SIGNALS))
    blocks = []
    for (controller, scenario), one in runs.items():
        s, step = one.scenario, 1 if max_samples is None else -(-one.time.size // max_samples)
        reference = np.full(one.time.size, np.nan) if s.controls_pressure else s.reference
        signals = [one.time, reference, s.force, s.supply, *one.model.T[of_model], *one.log.T[of_controller]]
        blocks.append((scenario, controller, *(signal[::step] for signal in signals)))
    columns = ", ".join(f"{n} [{unit}]" for n, (_, unit) in (MODEL_SIGNALS | CONTROLLER_SIGNALS).items())
    tables.write(name, f"scenario, controller, time, x_ref, load [N], p_supply, {columns}", blocks)


def figure_columns(names: Iterable[str]) -> str:
    """Return the columns of figures, each with the unit that its name ends in."""
    units = {"um": "um", "s": "s", "hz": "Hz", "v": "V", "kg": "kg", "pa": "Pa"}
    return ", ".join(f"{name} [{units.get(name.rpartition('_')[2], '1')}]" for name in names)
