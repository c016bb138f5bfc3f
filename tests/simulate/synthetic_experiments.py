"""A cylinder between two chambers and ready-made experiments on it, without sensors' noise or smoothing."""

from collections.abc import Sequence

import numpy as np

from pneucli.physics.declaration import Effect
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.motion_smoother import MeasuredMotion
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms import SwitchingValve, ValveArea

# of the size of the thesis's cylinder; no test depends on these very numbers
RIG = Rig(
    ambient_pressure=101_300.0,
    supply_pressure=7e5,
    piston_area_1=8.04e-4,
    piston_area_2=7.0e-4,
    stroke=0.2,
    dead_volume_1=32e-6,
    dead_volume_2=30e-6,
    moving_mass=2.2,
)
FRICTION = {"friction.coulomb": 14.0, "friction.viscous": 45.0}
# straight lines through knots that stand on the kernel's table of 5 mV, so that both read the same areas
VALVE = ValveArea((-10.0, -5.0, 5.0, 10.0), (1.8e-6, 0.9e-6, 0.9e-6, 1.8e-6))
SWITCHING = SwitchingValve(1.8e-6, 1.8e-6, 10.0)
STRIBECK = {"stribeck.static": 22.0, "stribeck.velocity": 0.015}
BALANCED = {"x": 0.1, "v": 0.0, "p1": 3e5, "p2": 101_300.0 + (3e5 - 101_300.0) * 8.04 / 7.0}


def model(names: Sequence[str] = (), values: dict[str, float] | None = None, rig: Rig = RIG) -> Model:
    """A model with named effects of the catalogue; its valve is a switching one where an effect is of such a valve."""
    effects = tuple(catalogue()[n] for n in names)
    valve = SWITCHING if any(e.part == "switching valve" for e in effects) else VALVE
    return Model(rig, effects, FRICTION | (values or {}), valve)


def typical_values(effects: Sequence[Effect], rig: Rig = RIG) -> dict[str, float]:
    """The first typical value of every parameter, in its unit."""
    facts = rig_quantities(Model(rig, (), FRICTION, VALVE))
    return {f"{e.name}.{p.name}": p.range_on(facts).typical[0] for e in effects for p in e.parameters}


def make_experiment(
    kind: str,
    time: np.ndarray,
    signals: dict[str, np.ndarray | float],
    chamber_2: str = "closed",
    restarts: Sequence[int] = (0,),
    valve_shut: bool = False,
    rig: Rig = RIG,
) -> Experiment:
    """An experiment whose inputs are the signals as they are; what is not among them is ``BALANCED``."""
    given = {"p_supply": rig.supply_pressure, **BALANCED, **signals}
    raw = {name: np.broadcast_to(np.asarray(value, float), time.shape) for name, value in given.items()}
    inputs = np.zeros((time.size, len(at.INPUTS)))
    for column, name in enumerate(at.INPUTS):
        if name in raw:
            inputs[:, column] = raw[name]
    flags = np.zeros(at.FLAGS)
    flags[at.MECHANICS], flags[at.PNEUMATICS] = kind != "valve", kind != "friction"
    flags[at.CHAMBER_2] = {"closed": at.CLOSED, "open": at.OPEN, "valve": at.VALVE_2}[chamber_2]
    flags[at.VALVE_SHUT], flags[at.U_MAX] = valve_shut, 10.0
    recorded = {name: raw[name] for name in signals}
    recording = Recording("bench", kind, "train", time, recorded, chamber_2=chamber_2, valve_shut=valve_shut)
    motion = MeasuredMotion(time) if "x" in raw else None
    return Experiment(recording, rig, raw, {}, {}, motion, inputs, np.array(restarts), flags)


def time_grid(duration: float, period: float = 1e-3) -> np.ndarray:
    """Equidistant time stamps in s."""
    return period * np.arange(round(duration / period) + 1)


def held_commands(time: np.ndarray, levels: Sequence[float], each: float) -> np.ndarray:
    """The levels in V one after the other, each held for ``each`` s, the last to the end."""
    return np.asarray(levels)[np.minimum((time / each + 1e-9).astype(int), len(levels) - 1)]
