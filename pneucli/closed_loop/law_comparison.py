"""Every law for one axis: the plan that they share, and the controllers that can be made of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pneucli.closed_loop.metrics import Metrics, evaluate_run
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, Scenario, simulate
from pneucli.controller.laws import LAWS
from pneucli.controller.laws.base import DesignData
from pneucli.controller.parameters import Controller
from pneucli.design.bandwidths import Bandwidths
from pneucli.design.lpv import WeightStudy as WeightStudy
from pneucli.design.requirements import Requirements
from pneucli.design.sliding import LinearSystem, surface_by_lq, surface_by_poles
from pneucli.errors import InputError
from pneucli.simulate.model import Model

# what each component of the cascade brings: the switches of the layout that take it out
COMPONENTS = {
    "feed-forward": ("C_FEEDFORWARD",),
    "estimates": ("C_DISTURBANCE_OBSERVERS",),
    "hold": ("C_HOLD",),
    "switching": ("C_SWITCHING",),
    "inverse map": ("C_INVERSE_MAP",),
    "all but the map": ("C_FEEDFORWARD", "C_DISTURBANCE_OBSERVERS", "C_HOLD", "C_SWITCHING"),
}
NO_COMPONENT = "nothing"


def sliding_surfaces(
    mechanical: LinearSystem, bandwidths: Bandwidths, requirements: Requirements
) -> list[dict[str, object]]:
    """Return the sliding line of the mechanical system (5.2) by pole placement and by LQ, and which one is taken.

    Where no weights are stated, those that make the error of one time constant of the position loop weigh as its rate.
    """
    weights = requirements.surface_weights or (bandwidths.position**2, 1.0)
    found = {
        "poles": surface_by_poles(mechanical.A, mechanical.B, [-bandwidths.position]),
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
            "taken": kind == requirements.surface,
        }
        for kind, one in found.items()
    ]


def collect_design_data(
    cascade: Controller,
    bandwidths: Bandwidths,
    requirements: Requirements,
    lines: Sequence[Mapping[str, object]],
    vertices: Sequence[float],
    weights: Sequence[WeightStudy],
    missing: Mapping[str, str],
) -> DesignData:
    """Return what laws are designed from; of the PDCs the one that is verified and decays fastest."""
    slope = next(float(line["slope"]) for line in lines if line["taken"])  # type: ignore[arg-type]
    kept = [(w.model, w.pdc) for w in weights if w.model is not None and w.pdc is not None and w.pdc.verified]
    fastest = max(kept, key=lambda pair: pair[1].rate, default=None)
    return DesignData(cascade, requirements, bandwidths, slope, tuple(vertices), fastest, missing)


def design_controllers(
    data: DesignData, names: Iterable[str] = tuple(LAWS)
) -> tuple[dict[str, Controller], dict[str, str]]:
    """Return the controllers by name, and of those that cannot be made why."""
    made, failed = {}, {}
    for name in names:
        try:
            made[name] = LAWS[name].controller(data)
        except InputError as error:
            failed[name] = f"{error.where}: {error.found}"
    return made, failed


def without_component(controller: Controller, component: str) -> Controller:
    """Return a controller without one of the ``COMPONENTS``, all else the same; ``NO_COMPONENT`` takes nothing out."""
    return controller.with_values(**dict.fromkeys(COMPONENTS.get(component, ()), 0.0))


def compare_laws(
    model: Model, controllers: Mapping[str, Controller], scenarios: Sequence[Scenario], setup: ClosedLoopSetup
) -> dict[str, dict[str, tuple[Run, Metrics]]]:
    """Return runs and figures by controller and scenario; a law without pressure loop has none of pressures."""
    found: dict[str, dict[str, tuple[Run, Metrics]]] = {}
    for name, controller in controllers.items():
        able = [s for s in scenarios if LAWS[controller.law].controls_pressure or not s.controls_pressure]
        runs = [simulate(model, controller, s, setup) for s in able]
        found[name] = {r.scenario.name: (r, evaluate_run(r, model, controller)) for r in runs}
    return found


def with_and_without_map(controllers: Mapping[str, Controller]) -> dict[str, Controller]:
    """Return each controller with and without the inverse of the valve's map."""
    bare = {f"{n}, no map": c.with_values(C_INVERSE_MAP=0.0) for n, c in controllers.items()}
    return {**controllers, **bare}
