"""An axis with one valve, of the size of ``fixtures/demo`` (``fixtures/truth.json``), and what tests do with it."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from pneucli.closed_loop.scenarios import equilibrium_at
from pneucli.closed_loop.simulation import ClosedLoopSetup, Scenario
from pneucli.controller.parameters import Controller
from pneucli.design.bandwidths import choose_bandwidths
from pneucli.design.cascade_design import design_cascade
from pneucli.design.control_laws import DesignData, collect_design_data, design_controllers, sliding_surfaces
from pneucli.design.pdc import compare_weight_types
from pneucli.design.requirements import Requirements
from pneucli.design.sliding import axis_systems
from pneucli.physics.effects import catalogue
from pneucli.recording import Rig
from pneucli.simulate.model import Model
from pneucli.simulate.valve_forms import ValveArea

TRUTH = json.loads((Path(__file__).parents[2] / "fixtures/truth.json").read_text())["demo"]["parameters"]
COMMANDS = (0.5, 1.0, 2.0, 3.5, 5.0, 7.5, 10.0)
BENCH = ClosedLoopSetup(noise_p=400.0, quantum_x=1e-6)  # the fixture's sensors
REQUIREMENTS = Requirements(quantum_x=1e-6, noise_p=400.0)
SEALED = 300e3  # Pa, with which the fixture's axis recordings start in the middle
RIG = Rig(
    gas_temperature=TRUTH["temperature"],
    ambient_pressure=TRUTH["ambient"],
    supply_pressure=TRUTH["supply"],
    piston_area_1=TRUTH["piston_area_1"],
    piston_area_2=TRUTH["piston_area_2"],
    stroke=TRUTH["stroke"],
    dead_volume_1=TRUTH["dead_volume_1"],
    dead_volume_2=TRUTH["dead_volume_2"],
    moving_mass=TRUTH["mass"],
)


def area(u: float) -> float:
    """The rig's valve law (pneucli.exam.rig.parameters)."""
    share = max(abs(u) - TRUTH["overlap"], 0.0) / (10.0 - TRUTH["overlap"])
    return float(TRUTH["effective_area"] * share ** TRUTH["exponent"])


def model() -> Model:
    commands = (*(-u for u in reversed(COMMANDS)), *COMMANDS)
    valve = ValveArea(commands, tuple(area(u) for u in commands), TRUTH["overlap"], TRUTH["overlap"])
    values = {
        "friction.coulomb": TRUTH["coulomb"],
        "friction.viscous": TRUTH["viscous"],
        "stribeck.static": TRUTH["static"],
        "stribeck.velocity": TRUTH["stribeck_velocity"],
    }
    return Model(RIG, (catalogue()["stribeck"],), values, valve)


def controller(requirements: Requirements = REQUIREMENTS) -> Controller:
    return design_cascade(model(), requirements, SEALED)


ARRANGEMENTS = ("one-chamber", "5/3", "two")


def arranged(arrangement: str) -> tuple[Model, Requirements]:
    """The axis with its valve connected otherwise, and what is then asked of the controller."""
    one = model()
    if arrangement == "one-chamber":
        return one, REQUIREMENTS
    rig = replace(RIG, valve_arrangement=arrangement)
    return replace(one, rig=rig), replace(REQUIREMENTS, chamber_2="valve")


@cache
def plan(arrangement: str = "one-chamber") -> DesignData:
    """What every law is designed from; the PDC has the smallest weight type that is quickly found."""
    one, wanted = arranged(arrangement)
    cascade = design_cascade(one, wanted, SEALED)
    corners, c = choose_bandwidths(one, wanted, cascade.values), cascade.values
    mechanical = axis_systems(c, 0.5 * c["C_STROKE"], c["C_P_MEAN"], c["C_P_MEAN"])["mechanical"]
    weights = compare_weight_types(c, 0.05, ("cno",))
    return collect_design_data(cascade, corners, wanted, sliding_surfaces(mechanical, corners, wanted), weights, {})


@cache
def bench_of_laws(arrangement: str = "one-chamber") -> tuple[Model, dict[str, Controller]]:
    """The axis and every law's controller for it."""
    made, failed = design_controllers(plan(arrangement))
    assert not failed
    return arranged(arrangement)[0], made


def scenario(c: Controller, reference: np.ndarray, force: np.ndarray | float = 0.0, **more: object) -> Scenario:
    """A scenario of the axis that begins in balance."""
    n = reference.size
    start = equilibrium_at(c.values, float(reference[0]))
    supply = np.full(n, c.values["C_SUPPLY"])
    return Scenario("test", reference, np.broadcast_to(force, n).astype(float), supply, start, **more)
