"""The designed controllers, as other stages and commands load them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller.parameters import Controller
from pneucli.design.requirements import Requirements
from pneucli.errors import InputError

CONTROLLERS_FOLDER = "controllers"  # a file a law


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
