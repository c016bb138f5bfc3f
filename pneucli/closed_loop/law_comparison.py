"""Every law for one axis: the plan that they share, and the controllers that can be made of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pneucli.closed_loop.metrics import Metrics, measure
from pneucli.closed_loop.simulation import Bench, Run, Scenario, run
from pneucli.controller.laws import LAWS
from pneucli.controller.laws.base import Plan
from pneucli.controller.parameters import Controller
from pneucli.design.bandwidths import Corners
from pneucli.design.lpv import Study as WeightStudy
from pneucli.design.requirements import Requirements
from pneucli.design.sliding import System, surface_by_lq, surface_by_poles
from pneucli.errors import InputError
from pneucli.simulate.model import Model

# what each component of the cascade brings: the switches of the layout that take it out
COMPONENTS = {
    "feed-forward": ("C_AHEAD",),
    "estimates": ("C_ESTIMATES",),
    "hold": ("C_HOLD",),
    "switching": ("C_SWITCHING",),
    "inverse map": ("C_INVERSE",),
    "all but the map": ("C_AHEAD", "C_ESTIMATES", "C_HOLD", "C_SWITCHING"),
}
WHOLE = "nothing"


def surfaces(mechanical: System, corners: Corners, wanted: Requirements) -> list[dict[str, object]]:
    """Return the sliding line of the mechanical system (5.2) by pole placement and by LQ, and which one is taken.

    Where no weights are stated, those that make the error of one time constant of the position loop weigh as its rate.
    """
    weights = wanted.surface_weights or (corners.position**2, 1.0)
    found = {
        "poles": surface_by_poles(mechanical.A, mechanical.B, [-corners.position]),
        "lq": surface_by_lq(mechanical.A, mechanical.B, np.diag(weights)),
    }
    titles = {"poles": "pole placement", "lq": "LQ"}
    return [
        {
            "system": "mechanical",
            "method": titles[kind],
            "surface": [float(v) for v in one.S[0]],
            "pole": float(one.poles[0].real),
            "slope": float(one.S[0][0] / one.S[0][1]),
            "taken": kind == wanted.surface,
        }
        for kind, one in found.items()
    ]


def plan_of(
    cascade: Controller,
    corners: Corners,
    wanted: Requirements,
    lines: Sequence[Mapping[str, object]],
    vertices: Sequence[float],
    weights: Sequence[WeightStudy],
    missing: Mapping[str, str],
) -> Plan:
    """Return what laws are designed from; of the PDCs the one that is verified and decays fastest."""
    slope = next(float(line["slope"]) for line in lines if line["taken"])  # type: ignore[arg-type]
    kept = [(w.model, w.pdc) for w in weights if w.model is not None and w.pdc is not None and w.pdc.verified]
    fastest = max(kept, key=lambda pair: pair[1].rate, default=None)
    return Plan(cascade, wanted, corners, slope, tuple(vertices), fastest, missing)


def controllers(plan: Plan, names: Iterable[str] = tuple(LAWS)) -> tuple[dict[str, Controller], dict[str, str]]:
    """Return the controllers by name, and of those that cannot be made why."""
    made, failed = {}, {}
    for name in names:
        try:
            made[name] = LAWS[name].controller(plan)
        except InputError as error:
            failed[name] = f"{error.where}: {error.found}"
    return made, failed


def without(controller: Controller, component: str) -> Controller:
    """Return a controller without one of the ``COMPONENTS``, all else the same; ``WHOLE`` takes nothing out."""
    return controller.with_values(**dict.fromkeys(COMPONENTS.get(component, ()), 0.0))


def trial(
    model: Model, controllers: Mapping[str, Controller], scenarios: Sequence[Scenario], bench: Bench
) -> dict[str, dict[str, tuple[Run, Metrics]]]:
    """Return runs and figures by controller and scenario; a law without pressure loop has none of pressures."""
    found: dict[str, dict[str, tuple[Run, Metrics]]] = {}
    for name, controller in controllers.items():
        able = [s for s in scenarios if LAWS[controller.law].pressure or not s.pressed]
        runs = [run(model, controller, s, bench) for s in able]
        found[name] = {r.scenario.name: (r, measure(r, model, controller)) for r in runs}
    return found


def mapped(controllers: Mapping[str, Controller]) -> dict[str, Controller]:
    """Return each controller with and without the inverse of the valve's map."""
    bare = {f"{n}, no map": c.with_values(C_INVERSE=0.0) for n, c in controllers.items()}
    return {**controllers, **bare}
