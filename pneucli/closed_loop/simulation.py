"""Closed-loop simulation: the compiled kernel with the code of the controller in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from pneucli.arrays import Array, read_only
from pneucli.controller import layout
from pneucli.controller.codegen import controller_source
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import with_catalogue
from pneucli.simulate import layout as at
from pneucli.simulate.build import Kernel, build
from pneucli.simulate.kernel_settings import max_motion_step
from pneucli.simulate.model import Model


@dataclass(frozen=True)
class ClosedLoopSetup:
    """Sensors and delay between axis and controller.

    Attributes:
        noise_x: 1 sigma of the position in m.
        noise_p: 1 sigma of the pressures in Pa.
        quantum_x: Quantum of the position in m, 0: none.
        quantum_p: Quantum of the pressures in Pa, 0: none.
        delay: Samples from reading to valve.
        supply: Whether the controller reads the supply pressure.

    """

    noise_x: float = 0.0
    noise_p: float = 0.0
    quantum_x: float = 0.0
    quantum_p: float = 0.0
    delay: int = 0
    supply: bool = False


@dataclass(frozen=True)
class Scenario:
    """Inputs of the axis over time, one value a sample of the controller: shapes ``(n,)``, SI.

    Attributes:
        name: Name of the scenario.
        reference: Position reference in m, or pressure of chamber 1 in Pa with ``controls_pressure``.
        force: Load on the piston toward +x in N.
        supply: Supply pressure in Pa.
        start: Initial x (m) and both pressures (Pa).
        dropouts: Missing readings ("x", "p1", "p2"), each with first and last time in s.
        controls_pressure: Pressure control; the piston is clamped at its start.
        operating_mode: Indices of ``layout.OPERATING_MODES``; None: run.
        level: Mean of both pressures that the user sets in Pa, 0: as designed; None: 0 throughout.

    """

    name: str
    reference: Array
    force: Array
    supply: Array
    start: tuple[float, float, float]
    dropouts: tuple[tuple[str, float, float], ...] = field(default=())
    controls_pressure: bool = False
    operating_mode: Array | None = None
    level: Array | None = None

    def supplied_by(self, model: Model, controller: Controller) -> Scenario:
        """Return the scenario with the supply of a model in place of that of the design."""
        factor = model.base_values()["rig.supply_pressure"] / controller.values["C_SUPPLY"]
        return self if factor == 1.0 else replace(self, supply=factor * self.supply)


@dataclass(frozen=True)
class Run:
    """A closed-loop run: output of the model ``(n, 9)`` (simulate.layout), log of the controller (L_ROW columns).

    ``states`` are those of the controller at the end, by :mod:`pneucli.controller.layout`.
    """

    scenario: Scenario
    time: Array
    model: Array
    log: Array
    states: Array = field(default_factory=lambda: np.zeros(layout.L_STATES))


@cache
def closed_loop_kernel(effects: tuple[Effect, ...]) -> Kernel:
    """Return the compiled kernel of the catalogue and of these effects with the controller in it."""
    return build(with_catalogue(effects), control=controller_source())


def simulate(model: Model, controller: Controller, scenario: Scenario, setup: ClosedLoopSetup, seed: int = 0) -> Run:
    """Simulate one scenario; the noise depends on the seed alone."""
    controller = controller.with_values(C_PRESSURE_MODE=float(scenario.controls_pressure))
    n = scenario.reference.size
    time: Array = controller.period * np.arange(n, dtype=np.float64)
    log = initial_log(scenario, setup, time, seed)
    state = np.concatenate([np.zeros(layout.L_STATES), log.ravel()])
    flags = _flags(controller, scenario.controls_pressure)
    out = _simulate(model, controller, flags, _inputs(scenario), state, setup)
    states, rows = state[: layout.L_STATES], state[layout.L_STATES :]
    return Run(scenario, time, out, rows.reshape(n, layout.L_ROW), states)


def simulate_open_loop(
    model: Model, controller: Controller, scenario: Scenario, commands: Array, restart: tuple[int, Array] | None = None
) -> Array:
    """Return the output of the model (n, 10) on a scenario under given ``commands`` (n, 2) in V.

    ``restart``: a sample, and readings (n, 4) of x, v, p1, p2 at which the measured states restart there.
    """
    inputs, flags, restarts = _inputs(scenario), _flags(controller), [0]
    inputs[:, [at.IN_U, at.IN_U2]] = commands
    flags[at.LOOP] = 0.0
    if restart is not None:
        restarts.append(restart[0])
        inputs[1:, [at.IN_X, at.IN_V, at.IN_P1, at.IN_P2]] = restart[1][1:]
    return _simulate(model, controller, flags, inputs, np.zeros(layout.L_STATES), ClosedLoopSetup(), restarts)


def _simulate(
    model: Model,
    controller: Controller,
    flags: Array,
    inputs: Array,
    state: Array,
    bench: ClosedLoopSetup,
    restarts: Sequence[int] = (0,),
) -> Array:
    """Run the kernel over inputs (n, 8), a row a period, and fill the ``state`` of the loop; returns (n, 10)."""
    kernel, n = closed_loop_kernel(model.effects), len(inputs)
    out = np.zeros((n, at.OUTPUTS))
    kernel.run(
        read_only(controller.period * np.arange(n, dtype=np.float64)),
        inputs,
        np.array(restarts, dtype=np.int64),
        np.array([model.base_values()[name] for name in at.BASE_NAMES]),
        kernel.effect_vector(model.effect_values()),
        kernel.effect_switches([e.name for e in model.effects]),
        flags,
        *(read_only(valve.table(controller.values["C_U_MAX"])) for valve in (model.valve, model.chamber_2_valve)),
        *2 * (max_motion_step(model.rig, controller.period),),
        state,
        np.concatenate([controller.vector(), _settings(controller, bench)]),
        out,
    )
    return out


def replay_log(model: Model, controller: Controller, signals: Mapping[str, Array], start_mode: str) -> Array:
    """Return the log (n, L_ROW) of a controller at logged readings, in the kernel with the axis at rest.

    Args:
        model: Any model of the axis.
        controller: The controller that ran.
        signals: x_ref, x (m), p1, p2 and p_supply if measured (Pa), u and u2 (V); NaN for a missing reading.
        start_mode: ``with`` the first sample, with a ``commission`` at the first sample, or ``before``: a reset from
            the first readings and commands; then the observers track the logged commands and converge anew.

    """
    return replay_states(model, controller, signals, start_mode)[1]


def replay_states(
    model: Model, controller: Controller, signals: Mapping[str, Array], start_mode: str
) -> tuple[Array, Array]:
    """Return the controller's states (L_STATES,) at the end of :func:`replay_log`, and its log."""
    n = signals["x_ref"].size
    inputs = np.zeros((n, len(at.INPUTS)))
    rows = np.zeros((n, layout.L_ROW))
    for place, name in ((at.IN_U, "x_ref"), (at.IN_X, "x"), (at.IN_P1, "p1"), (at.IN_P2, "p2")):
        inputs[:, place] = signals.get(name, np.full(n, np.nan))
    rows[:, layout.L_SUPPLY] = np.nan_to_num(signals.get("p_supply", np.zeros(n)))
    states = np.zeros(layout.L_STATES)
    if start_mode == "commission":
        rows[0, layout.L_MODE] = layout.OPERATING_MODES.index("commission")
    if start_mode == "before":
        rows[:, layout.L_MODE] = layout.OPERATING_MODES.index("follow")
        rows[0, layout.L_MODE] = layout.OPERATING_MODES.index("reset")
        for place, name in ((layout.L_U1, "u"), (layout.L_U2, "u2")):
            rows[1:, place] = np.nan_to_num(signals[name][:-1]) if name in signals else 0.0
        for place, name in ((layout.S_U1, "u"), (layout.S_U2, "u2")):
            states[place] = np.nan_to_num(signals[name][0]) if name in signals else 0.0
    state, flags = np.concatenate([states, rows.ravel()]), _flags(controller)
    flags[[at.MECHANICS, at.PNEUMATICS]] = 0.0
    _simulate(replace(model, effects=()), controller, flags, inputs, state, ClosedLoopSetup())
    return state[: layout.L_STATES], state[layout.L_STATES :].reshape(n, layout.L_ROW)


def _settings(controller: Controller, bench: ClosedLoopSetup) -> list[float]:
    """Return the numbers that follow the parameters of the controller: quanta, delay, index of the law."""
    return [bench.quantum_x, bench.quantum_p, bench.delay, list(LAWS).index(controller.law)]


def initial_log(scenario: Scenario, setup: ClosedLoopSetup, time: Array, seed: int) -> Array:
    """Return the log, shape ``(n, L_ROW)``, with sensor noise, and NaN for missing readings."""
    rows = np.zeros((time.size, layout.L_ROW))
    sigma = np.array([setup.noise_x, setup.noise_p, setup.noise_p])
    rows[:, :3] = sigma * np.random.default_rng(seed).standard_normal((time.size, 3))
    for signal, begin, end in scenario.dropouts:
        rows[(time >= begin) & (time < end), ("x", "p1", "p2").index(signal)] = np.nan
    if setup.supply:
        rows[:, layout.L_SUPPLY] = scenario.supply
    if scenario.operating_mode is not None:
        rows[:, layout.L_MODE] = scenario.operating_mode
    if scenario.level is not None:
        rows[:, layout.L_LEVEL] = scenario.level
    return rows


def _inputs(scenario: Scenario) -> Array:
    """Return the inputs of the kernel: the reference in place of the command, the initial state in the first row."""
    x, p1, p2 = scenario.start
    out = np.zeros((scenario.reference.size, len(at.INPUTS)))
    out[:, at.IN_U], out[:, at.IN_FORCE], out[:, at.IN_SUPPLY] = scenario.reference, scenario.force, scenario.supply
    out[:, [at.IN_X, at.IN_P1, at.IN_P2]] = x, p1, p2
    return out


def _flags(controller: Controller, clamped: bool = False) -> Array:
    flags = np.zeros(at.FLAGS)
    flags[[at.MECHANICS, at.PNEUMATICS, at.LOOP]] = 1.0 - clamped, 1.0, 1.0
    two, mirrored = (controller.values[name] > 0.5 for name in ("C_TWO_VALVES", "C_MIRRORED"))
    undriven = at.OPEN if controller.values["C_DEAD_VOLUME_2"] >= layout.OPEN_CHAMBER_VOLUME else at.CLOSED
    flags[at.CHAMBER_2] = at.MIRRORED if mirrored else at.VALVE_2 if two else undriven
    flags[at.U_MAX] = controller.values["C_U_MAX"]
    return flags
