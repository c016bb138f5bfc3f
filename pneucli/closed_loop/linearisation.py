"""The loop that is exported, linearised while the piston slides slowly: its controller and its axis, numerically.

The controller by perturbing the function that is exported, state by state and reading by reading; the axis by an
impulse of each command on the simulated model, and a realisation of its answer (Ho and Kalman 1966). Whatever stands in
either of them, observers, inverse map, lags, delays, sample-and-hold, is in the result.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.closed_loop.discrete_system import System, late, realised, told
from pneucli.closed_loop.scenarios import start_at
from pneucli.closed_loop.simulation import Bench, Run, Scenario, run, run_commanded
from pneucli.controller import layout
from pneucli.controller.codegen import operate
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.design.bandwidths import timing_of
from pneucli.design.requirements import Requirements
from pneucli.physics.declaration import Effect
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

READINGS = [at.X, at.R1, at.R2]
STATES = [at.X, at.V, at.R1, at.R2]  # that begin anew where they are read so
SEEN_AS = [at.X, at.R1, at.R2, at.V, at.P1, at.P2]  # with these seen, few samples show all that the axis is
LOGGED = [layout.L_READ_X, layout.L_READ_P1, layout.L_READ_P2]
SHAKEN = np.array([1e-6, 100.0, 100.0])  # m, Pa: readings are shaken by it to see by how much each state moves
FINE = 1e-2  # of what it moves a state is the perturbation
IMPULSE = 1e-5  # of the full command
SMALL = 0.1  # Pa, and what follows from it: a perturbation of the axis's state
RINGS = (layout.S_LINE1, layout.S_LINE2, layout.S_PAST1, layout.S_PAST2)
SETTLED = 15.0  # time constants of the position loop until the piston slides steadily
SEEN = 40  # samples of an answer, beside lags and delays
SHAKES = layout.LINE + 6  # samples over which readings are shaken: more than are remembered
FADED = 8.0  # time constants, over what is seen, by which the first samples count more: alone, the axis may be unstable
SPEEDS = (0.05, 0.1, 0.2, 0.4)  # of the reference's limit: the slowest at which the piston slides steadily
STEADY = 0.02  # of its speed by which it may be off then


@dataclass(frozen=True)
class Linear:
    """The loop about one operating point: the piston slides through ``x`` (m) at ``speed`` (m/s, signed).

    ``axis``: commands (V) -> readings of x, p1, p2 one sample later and on; ``law``: readings -> commands. ``uneven``:
    by how much the answers to both signs of a small impulse differ, over their size; ``missed``: of the axis's answer,
    what the realisation leaves.
    """

    x: float
    speed: float
    period: float
    axis: System
    law: System
    uneven: float
    missed: float


def smooth(model: Model) -> tuple[Model, tuple[str, ...]]:
    """Return the model without the effects that have no small-signal answer, and their titles.

    These leave a band in which nothing follows: a play between command and opening, two branches of friction.
    """
    kept = tuple(e for e in model.effects if not (e.bounds or _plays(model, e)))
    left = tuple(e.title for e in model.effects if e not in kept)
    return replace(model, effects=kept), left


def _plays(model: Model, effect: Effect) -> bool:
    """Whether a small impulse of the command, up or down, comes through otherwise than a large one."""
    if "command" not in effect.ports:
        return False
    top, own = max((abs(c) for c in model.valve.commands), default=1.0), model.own(effect)

    def opened(size: float) -> Array:
        s, out = 0.0, []
        for k in range(60):
            given: tuple[float, float] = effect.ports["command"](0.5 * top + size * (k == 50), s, 1e-3, *own)  # type: ignore[assignment]
            s = given[1]
            out.append(given[0])
        return np.array(out[50:])

    def answer(size: float) -> Array:
        return (opened(size) - opened(0.0)) / size

    small, back, large = (answer(share * top) for share in (1e-6, -1e-6, 0.4))
    return float(np.max(np.abs([small - large, back - large]))) > 0.1 * float(np.max(np.abs(large)))


def linearised(
    model: Model, controller: Controller, bench: Bench, corner: float, x: float, direction: float
) -> Linear | None:
    """Return the loop where the piston slides through ``x`` (m) that way; None where it sticks at every speed.

    ``corner``: that of the position loop in rad/s.
    """
    h, quiet = controller.period, replace(bench, noise_x=0.0, noise_p=0.0, quantum_x=0.0, quantum_p=0.0)
    before = math.ceil(SETTLED / corner / h)
    seen = SEEN + 3 * math.ceil(timing_of(model, Requirements(period=h)).whole / h)
    for share in SPEEDS:
        speed = direction * share * controller.values["C_V_MAX"]
        scenario = _ramp(controller, x, speed, before, max(seen, SHAKES))
        base = run(model, controller, scenario, quiet)
        if np.all(np.abs(base.model[before:, at.V] - speed) < STEADY * abs(speed)):
            axis, uneven, missed = _axis(model, controller, base, slice(before, before + seen), quiet.delay)
            law = _law(controller, base, before)
            return Linear(x, speed, h, axis, law, uneven, missed)
    return None


def _ramp(controller: Controller, x: float, speed: float, before: int, seen: int) -> Scenario:
    """Return a reference at one speed that passes x (m) in the middle of what is seen."""
    time = controller.period * (np.arange(before + seen + 1) - before - 0.5 * seen)
    reference = np.clip(x + speed * time, 0.0, controller.values["C_STROKE"])
    supply = np.full(time.size, controller.values["C_SUPPLY"])
    start = start_at(controller.values, float(reference[0]))
    return Scenario("linearised", reference, np.zeros(time.size), supply, start)


@dataclass(frozen=True)
class _Open:
    """The loop of a run cut open: the axis under the run's commands, which begins anew at sample k.

    ``counted``: in what x, v, p1, p2 are counted: so much follows within three samples from 1 Pa.
    """

    model: Model
    controller: Controller
    base: Run
    k: int
    commands: Array
    counted: Array

    def answer(self, size: float, valve: int = -1, state: int = -1) -> Array:
        """Return what is seen (n, 6) where a command at sample k (V), or a state from k on (SI), is off by ``size``."""
        commands, readings = self.commands.copy(), self.base.model[:, STATES]
        if valve >= 0:
            commands[self.k, valve] += size
        if state >= 0:
            readings[self.k :, state] += size
        out = run_commanded(self.model, self.controller, self.base.scenario, commands, (self.k, readings))
        return np.asarray(out[:, SEEN_AS] / self.counted[[0, 2, 3, 1, 2, 3]])


def _open(model: Model, controller: Controller, base: Run, k: int, delay: int) -> _Open:
    c, commands = controller.values, base.log[:, [layout.L_U1, layout.L_U2]]
    late_by = np.tile(commands[0], (delay, 1))
    time = 3.0 * controller.period
    speed = time * c["C_AREA_1"] / c["C_MASS"]
    counted = np.array([time * speed, speed, 1.0, 1.0])
    return _Open(model, controller, base, k, np.vstack([late_by, commands])[: len(commands)], counted)


def _axis(model: Model, controller: Controller, base: Run, over: slice, delay: int) -> tuple[System, float, float]:
    """Return the axis from the commands as computed to the readings, how uneven its answer is, and what is missed."""
    k, n = over.start, over.stop - over.start
    loop = _open(model, controller, base, k, delay)
    rest, size, valves = loop.answer(0.0), IMPULSE * controller.values["C_U_MAX"], _valves(controller)
    pushes = [(SMALL * float(loop.counted[i]), {"state": i}, k) for i in range(len(STATES))]
    pushes += [(size, {"valve": i}, k + 1) for i in range(valves)]
    columns, uneven, sizes = [], 0.0, []
    for off, where, first in pushes:
        up, down = (sign * (loop.answer(sign * off, **where) - rest)[first:] for sign in (1.0, -1.0))
        both = 0.5 * (up + down)[:n]
        most = float(np.max(np.abs(both))) or 1.0
        uneven = max(uneven, float(np.max(np.abs(up - down))) / most)
        columns.append(both / most)
        sizes.append(off / most)
    fading = np.exp(-FADED / n * np.arange(n))[:, None, None]
    whole, missed = realised(fading * np.stack(columns, axis=2))
    seen, driven = loop.counted[[0, 2, 3], None] * whole.C[:3], whole.B[:, -valves:] / np.array(sizes[-valves:])
    return late(System(whole.A * math.exp(FADED / n), driven, seen, np.zeros((3, valves))), delay), uneven, missed


def _valves(controller: Controller) -> int:
    return 2 if controller.values["C_TWO_VALVES"] > 0.5 else 1


@dataclass(frozen=True)
class _Function:
    """The controller's own function, along the readings and references of a run."""

    law: int
    numbers: list[float]
    base: Run

    def sample(self, k: int, off: Array | float, state: Array) -> Array:
        """Return the state after sample k, the readings being off by that much (3,)."""
        s = state.tolist()
        x, p1, p2 = (self.base.log[k, LOGGED] + off).tolist()
        operate(self.law, float(self.base.scenario.reference[k]), x, p1, p2, 0.0, 0.0, 0.0, s, self.numbers)
        return _unrolled(np.array(s))

    def until(self, k: int) -> Array:
        """Return the state before sample k, from the start on."""
        state = np.zeros(layout.L_STATES)
        for i in range(k):
            state = self.sample(i, 0.0, state)
        return state

    def shaken(self, k: int, state: Array) -> Array:
        """Return by how much each state moves from sample k on where the readings are shaken."""
        rng, plain, most = np.random.default_rng(0), state, np.zeros(layout.L_STATES)
        for i in range(k, k + SHAKES):
            plain, state = self.sample(i, 0.0, plain), self.sample(i, SHAKEN * rng.standard_normal(3), state)
            most = np.maximum(most, np.abs(state - plain))
        return most


def _unrolled(state: Array) -> Array:
    """Return a state whose rings are turned back, so that the same delay stands in the same place at every sample."""
    turns = int(state[layout.S_TURN])
    for ring in RINGS:
        places = slice(ring, ring + layout.LINE)
        state[places] = np.roll(state[places], -turns)
    state[layout.S_TURN] = 0.0
    return state


def _law(controller: Controller, base: Run, k: int) -> System:
    """Return the controller at sample k of a run, by perturbing its function, less the states that no reading moves."""
    function = _Function(list(LAWS).index(controller.law), controller.vector().tolist(), base)
    state = function.until(k)
    sizes = FINE * function.shaken(k, state)
    moved = np.flatnonzero(sizes > 0.0)
    commands = [layout.S_U1, layout.S_U2][: _valves(controller)]
    columns = []
    for place in moved:
        step = np.zeros(layout.L_STATES)
        step[place] = sizes[place]
        columns.append(
            (function.sample(k, 0.0, state + step) - function.sample(k, 0.0, state - step)) / 2 / sizes[place]
        )
    for off in np.diag(FINE * SHAKEN):
        columns.append((function.sample(k, off, state) - function.sample(k, -off, state)) / 2 / off.max())
    whole, n = np.stack(columns, axis=1), moved.size
    return told(System(whole[moved, :n], whole[moved, n:], whole[commands, :n], whole[commands, n:]))
