"""Comparison of controllers: laws on the same scenarios, without the inverse map, or without a component."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pneucli.closed_loop.metrics import Metrics, evaluate_run
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, Scenario, simulate
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
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


def without_component(controller: Controller, component: str) -> Controller:
    """Return a controller without one of ``COMPONENTS``, all else equal; ``NO_COMPONENT`` changes nothing."""
    return controller.with_values(**dict.fromkeys(COMPONENTS.get(component, ()), 0.0))


def compare_laws(
    model: Model, controllers: Mapping[str, Controller], scenarios: Sequence[Scenario], setup: ClosedLoopSetup
) -> dict[str, dict[str, tuple[Run, Metrics]]]:
    """Simulate controllers on scenarios.

    Args:
        model: The axis.
        controllers: Controllers by name.
        scenarios: Scenarios of all; a law without pressure loop skips those of pressure control.
        setup: Noise, quanta and delay of the sensors.

    Returns:
        Runs with their figures, by name of the controller and of the scenario.

    """
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
