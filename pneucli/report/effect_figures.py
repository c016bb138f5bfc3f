"""Draw an effect: a standard experiment simulated with and without it, and their difference."""

import io
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from pneucli.arrays import Array
from pneucli.compare.error_regions import locator_signals
from pneucli.experiments import EXPERIMENT_KINDS
from pneucli.messages.formatting import axis_title, in_display_unit, signal_unit, unit_symbol
from pneucli.physics.declaration import Effect
from pneucli.quantities import SIGNALS
from pneucli.recording import Recording, Rig
from pneucli.report.figure import BLUE, GREY, ORANGE
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, restart_samples
from pneucli.simulate.model import Model
from pneucli.simulate.motion_smoother import MeasuredMotion
from pneucli.simulate.outputs import simulate_outputs
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms import SwitchingValve, ValveArea

# the rig of fixtures/demo, which is of the size of the thesis's cylinder
CYLINDER = Rig(
    supply_pressure=7e5,
    piston_area_1=8.04e-4,
    piston_area_2=8.04e-4,
    stroke=0.2,
    dead_volume_1=32e-6,
    dead_volume_2=30e-6,
    moving_mass=2.2,
)
VESSEL = replace(CYLINDER, piston_area_1=None, piston_area_2=None, stroke=None, moving_mass=None)
VALVE = ValveArea((-10.0, -5.0, 5.0, 10.0), (1.8e-6, 0.8e-6, 0.8e-6, 1.8e-6))
SWITCHING = SwitchingValve(1.8e-6, 1.8e-6, 10.0)
VALUES = {"friction.coulomb": 14.0, "friction.viscous": 45.0, "rig.vessel_volume": 160e-6}
TIME: Array = np.arange(4001, dtype=np.float64) * 1e-3
HORIZON = 0.5  # s, the default of the comparison
# noise of common sensors of such a rig, in which channels of different units are compared
NOISE = {"p1": 400.0, "p2": 400.0, "x": 1e-5, "v": 5e-3, "a": 0.05, "force": 0.3}
FIGURE_STYLE: Any = {"svg.hashsalt": "pneucli", "svg.fonttype": "none", "font.family": "DejaVu Sans", "font.size": 8.5}
FIGURE_STYLE |= {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "text.parse_math": False,
}


def effect_figure(effect: Effect) -> str:
    """Return an SVG: left the channel with and without the effect, right the difference over the decisive variable.

    The effect has the middle one of its typical values. The model without it has the same other parameters and is
    restarted every 0.5 s, as in a comparison. The figure shows the first of ``standard_experiments`` in which the
    effect is visible, and the channel that differs most in units of its sensor's noise. Raises ValueError where the
    effect is visible in none.
    """
    for experiment in standard_experiments():
        if experiment.active_effects((effect,)) and effect.shows_over in locator_signals(experiment):
            seen, base = _with_and_without(effect, experiment)
            channel, size = max(((c, _noise_ratio(c, seen, base)) for c in base), key=lambda pair: pair[1])
            if size > 1.0:
                return _draw(effect, seen, channel, base[channel])
    raise ValueError(f"{effect.name} is visible in no standard experiment")


def standard_experiments() -> Iterator[Experiment]:
    """Yield the standard experiments: a valve test, chambers and force balance under a given motion, a driven axis.

    They last 4 s at 1 kHz and have no noise.
    """
    flat = np.ones_like(TIME)
    levels = np.array([6.0, 0.0, -6.0, 0.0, 2.0, -2.0, 3.0, -3.0])
    held = np.maximum(TIME - 0.1, 0.0) / HORIZON  # steps fall between the restarts
    u = np.where(TIME < 0.1, 0.0, levels[held.astype(int)])
    yield _experiment("valve", {"u": u, "p1": 101_325.0 * flat}, VESSEL)
    push = 6.0 * np.sin(2 * np.pi * 0.9 * TIME)
    given = _experiment("axis", {"u": push, "p1": 3e5 * flat, "p2": 2e5 * flat, **_motion(0.05)})
    given.flags[at.MECHANICS] = 0.0
    yield given
    swing = 3e5 + 1.2e5 * np.sin(2 * np.pi * 1.3 * TIME)
    forced = _experiment("friction", {"p1": swing, "p2": 3e5 * flat, **_motion(0.098), "force": 0.0 * flat})
    yield replace(forced, recording=replace(forced.recording, imposed="motion"))
    drive = 3e5 + 4.5e4 * np.sin(2 * np.pi * 0.75 * TIME) * np.minimum(TIME, 1.0)
    yield _experiment("friction", {"p1": drive, "p2": 3e5 * flat, **_motion(0.0)})


def _motion(amplitude: float) -> dict[str, Array]:
    """Return x, v and a of two cycles of 2 s about the middle of the stroke; SI."""
    omega = np.pi
    x = -amplitude * np.cos(omega * TIME)
    return {"x": 0.1 + x, "v": amplitude * omega * np.sin(omega * TIME), "a": -(omega**2) * x}


def _experiment(kind: Any, signals: dict[str, Array], rig: Rig = CYLINDER) -> Experiment:
    inputs = np.zeros((TIME.size, len(at.INPUTS)))
    inputs[:, at.IN_P1] = inputs[:, at.IN_P2] = rig.ambient_pressure
    inputs[:, at.IN_SUPPLY] = rig.supply_pressure
    for column, name in enumerate(at.INPUTS):
        if name in signals:
            inputs[:, column] = signals[name]
    flags = np.zeros(at.FLAGS)
    flags[at.MECHANICS], flags[at.PNEUMATICS] = EXPERIMENT_KINDS[kind].cylinder, EXPERIMENT_KINDS[kind].valve
    vessel = EXPERIMENT_KINDS[kind].vessel
    flags[at.CHAMBER_2], flags[at.U_MAX] = at.OPEN if vessel else at.CLOSED, 10.0
    recording = Recording(kind, kind, "train", TIME, signals, chamber_2=None if vessel else "closed")
    motion = MeasuredMotion(recording.time) if "x" in signals else None
    return Experiment(recording, rig, signals, {}, {}, motion, inputs, np.zeros(1, dtype=np.int64), flags)


def _with_and_without(effect: Effect, experiment: Experiment) -> tuple[Experiment, dict[str, Array]]:
    """Return the experiment as recorded on a rig with the effect, and the channels of the model without it."""
    base = Model(experiment.rig, (), VALUES, SWITCHING if effect.part == "switching valve" else VALVE)
    facts = rig_quantities(replace(base, rig=CYLINDER))
    values = {f"{effect.name}.{p.name}": p.range_on(facts).typical[len(p.typical) // 2] for p in effect.parameters}
    true = simulate_outputs(replace(base, effects=(effect,), values=VALUES | values), experiment)
    inputs = experiment.inputs.copy()
    for column, name in enumerate(at.INPUTS):
        if name in true:
            inputs[:, column] = true[name]
    raw = {**experiment.raw, **true}
    seen = replace(experiment, raw=raw, inputs=inputs, restarts=restart_samples(TIME, HORIZON))
    return seen, simulate_outputs(base, seen)


def _noise_ratio(channel: str, seen: Experiment, base: dict[str, Array]) -> float:
    return float(np.sqrt(np.mean((seen.raw[channel] - base[channel]) ** 2))) / NOISE[channel]


def _draw(effect: Effect, seen: Experiment, channel: str, base: Array) -> str:
    q, over = SIGNALS[channel], effect.shows_over
    true, base = in_display_unit(seen.raw[channel], q.unit), in_display_unit(base, q.unit)
    with matplotlib.rc_context(FIGURE_STYLE):
        figure = Figure(figsize=(7.4, 2.7), layout="constrained")
        left, right = figure.subplots(1, 2)
        some = slice(None, None, 8)
        left.plot(TIME[some], true[some], color=GREY, lw=2.2, label="with it")
        left.plot(TIME[some], base[some], color=ORANGE, lw=1.0, label="model without it")
        left.set(xlabel="time in s", ylabel=axis_title(channel))
        left.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=7.5)
        variable = in_display_unit(locator_signals(seen)[over], signal_unit(over))
        right.plot(variable[some], (true - base)[some], ".", color=BLUE, ms=2.5)
        right.axhline(0.0, color=GREY, lw=0.6)
        right.set(xlabel=axis_title(over), ylabel=f"difference of {q.symbol} in {unit_symbol(q.unit)}")
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    return _rounded_coordinates(text.getvalue())


def _rounded_coordinates(svg: str) -> str:
    """Return the file with coordinates rounded to hundredths of a point; labels, which are no attributes, stay."""
    return re.sub(r'"[^"]*"', lambda found: re.sub(r"(\d\.\d\d)\d+", r"\1", found[0]), svg)
