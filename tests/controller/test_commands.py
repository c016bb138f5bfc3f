"""What each law commands, as stored, at readings that are the same whatever it commands."""

from pathlib import Path

import numpy as np

from pneucli.controller import layout as at
from pneucli.controller.laws import LAWS
from pneucli.controller.operation import active_reference, finish_commands
from pneucli.controller.parameters import Controller
from pneucli.design.cascade_design import design_cascade
from pneucli.design.control_laws import design_variants
from tests.design import axis
from tests.design.test_numbers import model_of
from tests.stored import hold_against

K = np.arange(600)
SHOWN = (0, 1, 60, 62, 70, 90, 120, 180, 240, 301, 303, 306, 340, 400, 450, 520, 599)
TOLD = (at.S_U1, at.S_U2, at.S_V, at.S_LOAD, at.S_FORCE, at.S_RATE1, at.S_FLOW1)
EFFECTS = (
    {"valve-lag.time_constant": 0.017}, {"valve-hysteresis.half_width": 0.2}, {"valve-deadband.width": 0.8},
    {"line-delay.delay": 0.011}, {"pressure-lag.time_constant": 0.012}, {"time-skew.delay": 0.012},
    {"pressure-scale.scale": 1.05}, {"pressure-offset.offset": 1e4}, {"chamber-leak.area": 3e-8},
    {"piston-leak.area": 3e-8}, {"valve-leak.area": 3e-8}, {"pressure-friction.gain": 0.2},
    {"position-friction.from": 0.08, "position-friction.to": 0.12, "position-friction.gain": 1.5},
    {"friction-hysteresis.drop": 0.4}, {"friction-hysteresis.drop": 0.0},
    {"friction-asymmetry.asymmetry": 0.2, "friction-asymmetry.viscous_asymmetry": 0.1},
    {"end-cushion.length": 0.1, "end-cushion.damping": 200.0},
    {"spring-force.stiffness": 200.0, "spring-force.rest_position": 0.1},
)  # fmt: skip


def readings() -> np.ndarray:
    """Reference, position and both pressures, (n, 4): it moves 20 mm, sticks 20 um off, loses p1, is pushed away."""
    rig, values = axis.RIG, axis.model().values
    reference = 0.1 + 0.01 * (1.0 - np.cos(np.pi * np.clip(K - 60, 0, 240) / 240))
    x = np.interp(K - 4, K, reference) - 20e-6 * (K > 200) - 1e-4 * np.clip(K - 480, 0, 20)
    v = np.gradient(x, 1e-3)
    force = values["friction.coulomb"] * np.tanh(100.0 * v) + values["friction.viscous"] * v + 3.0 * (K > 350)
    p2 = 3e5 + 5e3 * np.sin(0.02 * K)
    p1 = rig.ambient_pressure + (force + rig.piston_areas[1] * (p2 - rig.ambient_pressure)) / rig.piston_areas[0]
    p1[302:305] = np.nan
    return np.column_stack([reference, x, p1, p2])


def commanded(controller: Controller) -> str:
    """Commands in V, the speed, load, force and rate of pressure that it knows or asks for, at some of the samples."""
    s, c, told = np.zeros(at.L_STATES), controller.vector(), []
    for k, (x_ref, *read) in enumerate(readings().tolist()):
        LAWS[controller.law].step(active_reference(x_ref, *read, s, c), *read, s, c)
        finish_commands(s, c)
        if k in SHOWN:
            told.append(" ".join(f"{round(float(s[i]), 7) + 0.0:.7g}" for i in TOLD))
    return " | ".join(told)


def test_what_each_law_commands_is_as_stored() -> None:
    """But for the PDC, whose gains are as exact as a solver finds them."""
    made = {
        f"{law}, {one}": c for one in axis.ARRANGEMENTS for law, c in axis.bench_of_laws(one)[1].items() if law != "pdc"
    }
    made |= design_variants(axis.plan(), LAWS)
    made |= {str(one): design_cascade(model_of({"values": one}), axis.REQUIREMENTS, axis.SEALED) for one in EFFECTS}
    lines = [f"{name}: {commanded(controller)}" for name, controller in made.items()]
    hold_against(Path(__file__).parent / "stored" / "commands.txt", "\n".join(lines) + "\n", rel=1e-4)
