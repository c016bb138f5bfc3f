"""Margins of the exported loop: gain, phase and delay, and its poles, at operating points along the stroke.

The return ratio L of a loop that is cut with all others closed gives the gain and the delay at which it oscillates
(Nyquist). The cuts are at each valve's command and at the reading of the position. Margins are small-signal statements
about a sliding piston; a sticking piston, or a valve within its overlap, does not follow small signals.

The controller is linearised by perturbation of its exported function, state by state and reading by reading; the axis
by an impulse of each command on the simulated model and a realisation of its response (Ho and Kalman 1966). Observers,
inverse map, lags, delays and sample-and-hold are therefore included.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.closed_loop.scenarios import equilibrium_at
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, Scenario, simulate, simulate_open_loop
from pneucli.controller import layout
from pneucli.controller.codegen import operate
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.design.bandwidths import loop_timing
from pneucli.design.effect_compensation import opening_after
from pneucli.design.requirements import Requirements
from pneucli.messages.design import LoopMargins
from pneucli.physics.declaration import Effect
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model

SINGULAR_VALUE_TOLERANCE = (
    1e-4  # singular values below that share of the largest are the way that the piston makes meanwhile
)

RESTARTED_STATES = [at.X, at.V, at.R1, at.R2]  # that begin anew where they are read so
OBSERVED_OUTPUTS = [at.X, at.R1, at.R2, at.V, at.P1, at.P2]  # with these seen, few samples show all that the axis is
LOGGED_READINGS = [layout.L_READ_X, layout.L_READ_P1, layout.L_READ_P2]
READING_PERTURBATION = np.array(
    [1e-6, 100.0, 100.0]
)  # m, Pa: readings are shaken by it to see by how much each state moves
STATE_STEP_RATIO = 1e-2  # of what it moves a state is the perturbation
IMPULSE_RATIO = 1e-5  # of the full command
PRESSURE_PERTURBATION = 0.1  # Pa, and what follows from it: a perturbation of the axis's state
DELAY_LINES = (layout.S_OPENING_LINE1, layout.S_OPENING_LINE2, layout.S_PRESSURE_LINE1, layout.S_PRESSURE_LINE2)
SETTLING_TIME_CONSTANTS = 15.0  # time constants of the position loop until the piston slides steadily
RESPONSE_SAMPLES = 40  # samples of an answer, in addition to lags and delays
PERTURBED_SAMPLES = layout.DELAY_LINE_SAMPLES + 6  # samples over which readings are shaken: more than are remembered
FADING_TIME_CONSTANTS = (
    8.0  # time constants, over what is seen, by which the first samples count more: alone, the axis may be unstable
)
SPEED_FRACTIONS = (0.05, 0.1, 0.2, 0.4)  # of the reference's limit: the slowest at which the piston slides steadily
SPEED_TOLERANCE = 0.02  # of its speed by which it may be off then


@dataclass(frozen=True)
class DiscreteSystem:
    """A discrete-time linear system: ``x+ = A x + B u``, ``y = C x + D u``; u and y in SI."""

    A: Array
    B: Array
    C: Array
    D: Array

    def transfer_matrix(self, z: Array) -> Array:
        """Return the transfer matrix at the complex numbers ``z`` (n,): shape (n, outputs, inputs)."""
        if not self.A.size:
            return np.broadcast_to(self.D.astype(complex), (z.size, *self.D.shape))
        inner = z[:, None, None] * np.eye(len(self.A)) - self.A
        return np.asarray(self.C @ np.linalg.solve(inner, self.B.astype(complex)[None]) + self.D)


def realise_impulse_response(markov: Array) -> tuple[DiscreteSystem, float]:
    """Return a system with the impulse response ``markov`` (n, outputs, inputs), and the relative error of it.

    Scale outputs and inputs to responses of about 1.

    References:
        Ho and Kalman (1966); Kung (1978), by the singular values of the block Hankel matrix.

    """
    n, outputs, inputs = markov.shape
    half = n // 2
    rows = np.arange(half)[:, None] + np.arange(half)
    hankel, shifted = (markov[rows + i].transpose(0, 2, 1, 3).reshape(half * outputs, half * inputs) for i in (0, 1))
    left, size, right = np.linalg.svd(hankel, full_matrices=False)
    order = int(np.sum(size > SINGULAR_VALUE_TOLERANCE * size[0]))
    root = np.sqrt(size[:order])
    U, V = left[:, :order], right[:order].T
    A, B, C = (U / root).T @ shifted @ (V / root), (V * root).T[:, :inputs], (U * root)[:outputs]
    missed = float(np.max(np.abs(impulse_response(A, B, C, n) - markov)))
    return DiscreteSystem(A, B, C, np.zeros((outputs, inputs))), missed


def with_input_delay(system: DiscreteSystem, samples: int) -> DiscreteSystem:
    """Return a system whose inputs are delayed by a number of samples."""
    m = system.B.shape[1]
    for _ in range(samples):
        A = np.block([[system.A, system.B], [np.zeros((m, len(system.A) + m))]])
        B = np.vstack([np.zeros((len(system.A), m)), np.eye(m)])
        system = DiscreteSystem(A, B, np.hstack([system.C, np.zeros((len(system.C), m))]), system.D)
    return system


def impulse_response(A: Array, B: Array, C: Array, n: int) -> Array:
    """Return the impulse response from the next sample on, shape (n, outputs, inputs)."""
    found, state = np.empty((n, len(C), B.shape[1])), B
    for i in range(n):
        found[i] = C @ state
        state = A @ state
    return np.nan_to_num(found, nan=np.inf, posinf=np.inf, neginf=-np.inf)


def observable_part(system: DiscreteSystem) -> DiscreteSystem:
    """Return a system without the states that do not reach an output."""
    kept = np.any(system.C != 0.0, axis=0)
    while np.any(more := np.any(system.A[kept] != 0.0, axis=0) & ~kept):
        kept |= more
    return DiscreteSystem(system.A[np.ix_(kept, kept)], system.B[kept], system.C[:, kept], system.D)


@dataclass(frozen=True)
class LinearisedLoop:
    """The loop about one operating point: the piston slides through ``x`` (m) at ``speed`` (m/s, signed).

    Attributes:
        axis: Commands (V) to the readings of x, p1, p2 from the next sample on.
        controller: Readings to commands.
        asymmetry: Relative difference of the responses to impulses of both signs.
        realisation_error: Relative error of the realisation of the axis.

    """

    x: float
    speed: float
    period: float
    axis: DiscreteSystem
    controller: DiscreteSystem
    asymmetry: float
    realisation_error: float


def without_nonsmooth_effects(model: Model) -> tuple[Model, tuple[str, ...]]:
    """Return the model without the effects that have no small-signal response, and their titles.

    These are a play between command and opening, and two branches of friction: within their band nothing follows.
    """
    kept = tuple(e for e in model.effects if not (e.is_set_valued or _has_play(model, e)))
    left = tuple(e.title for e in model.effects if e not in kept)
    return replace(model, effects=kept), left


def _has_play(model: Model, effect: Effect) -> bool:
    """Whether the response to a small impulse of the command differs from that to a large one."""
    if "command" not in effect.ports:
        return False
    top, own = max((abs(c) for c in model.valve.commands), default=1.0), model.effect_parameters(effect)

    def opened(size: float) -> Array:
        states, out = (0.0, 0.0), []
        for k in range(60):
            opening, states = opening_after(effect, 0.5 * top + size * (k == 50), states, 1e-3, own)
            out.append(opening)
        return np.array(out[50:])

    def answer(size: float) -> Array:
        return (opened(size) - opened(0.0)) / size

    small, back, large = (answer(share * top) for share in (1e-6, -1e-6, 0.4))
    return float(np.max(np.abs([small - large, back - large]))) > 0.1 * float(np.max(np.abs(large)))


def linearise(
    model: Model, controller: Controller, setup: ClosedLoopSetup, corner: float, x: float, direction: float
) -> LinearisedLoop | None:
    """Return the loop about a piston that slides through ``x`` (m); None if it sticks at every speed.

    ``corner``: corner of the position loop in rad/s.
    """
    h, quiet = controller.period, replace(setup, noise_x=0.0, noise_p=0.0, quantum_x=0.0, quantum_p=0.0)
    before = math.ceil(SETTLING_TIME_CONSTANTS / corner / h)
    seen = RESPONSE_SAMPLES + 3 * math.ceil(loop_timing(model, Requirements(period=h)).total_delay / h)
    for share in SPEED_FRACTIONS:
        speed = direction * share * controller.values["C_V_MAX"]
        scenario = _ramp(controller, x, speed, before, max(seen, PERTURBED_SAMPLES))
        base = simulate(model, controller, scenario, quiet)
        if np.all(np.abs(base.model[before:, at.V] - speed) < SPEED_TOLERANCE * abs(speed)):
            axis, uneven, missed = _linearise_axis(model, controller, base, slice(before, before + seen), quiet.delay)
            law = _linearise_controller(controller, base, before)
            return LinearisedLoop(x, speed, h, axis, law, uneven, missed)
    return None


def _ramp(controller: Controller, x: float, speed: float, before: int, seen: int) -> Scenario:
    """Return a reference of constant speed that passes x (m) in the middle of the evaluated samples."""
    time = controller.period * (np.arange(before + seen + 1) - before - 0.5 * seen)
    reference = np.clip(x + speed * time, 0.0, controller.values["C_STROKE"])
    supply = np.full(time.size, controller.values["C_SUPPLY"])
    start = equilibrium_at(controller.values, float(reference[0]))
    return Scenario("linearised", reference, np.zeros(time.size), supply, start)


@dataclass(frozen=True)
class _OpenLoop:
    """The open loop of a run: the axis under the commands of the run, restarted at sample k.

    ``counted``: scale of x, v, p1, p2, their response to 1 Pa within three samples.
    """

    model: Model
    controller: Controller
    base: Run
    k: int
    commands: Array
    counted: Array

    def answer(self, size: float, valve: int = -1, state: int = -1) -> Array:
        """Return the response (n, 6) to a deviation of a command at sample k (V), or of a state from k on (SI)."""
        commands, readings = self.commands.copy(), self.base.model[:, RESTARTED_STATES]
        if valve >= 0:
            commands[self.k, valve] += size
        if state >= 0:
            readings[self.k :, state] += size
        out = simulate_open_loop(self.model, self.controller, self.base.scenario, commands, (self.k, readings))
        return np.asarray(out[:, OBSERVED_OUTPUTS] / self.counted[[0, 2, 3, 1, 2, 3]])


def _open_loop(model: Model, controller: Controller, base: Run, k: int, delay: int) -> _OpenLoop:
    c, commands = controller.values, base.log[:, [layout.L_U1, layout.L_U2]]
    late_by = np.tile(commands[0], (delay, 1))
    time = 3.0 * controller.period
    speed = time * c["C_AREA_1"] / c["C_MASS"]
    counted = np.array([time * speed, speed, 1.0, 1.0])
    return _OpenLoop(model, controller, base, k, np.vstack([late_by, commands])[: len(commands)], counted)


def _linearise_axis(
    model: Model, controller: Controller, base: Run, over: slice, delay: int
) -> tuple[DiscreteSystem, float, float]:
    """Return the axis from computed commands to readings, its asymmetry, and the error of the realisation."""
    k, n = over.start, over.stop - over.start
    loop = _open_loop(model, controller, base, k, delay)
    rest, size, valves = loop.answer(0.0), IMPULSE_RATIO * controller.values["C_U_MAX"], _valves(controller)
    pushes = [(PRESSURE_PERTURBATION * float(loop.counted[i]), {"state": i}, k) for i in range(len(RESTARTED_STATES))]
    pushes += [(size, {"valve": i}, k + 1) for i in range(valves)]
    columns, uneven, sizes = [], 0.0, []
    for off, where, first in pushes:
        up, down = (sign * (loop.answer(sign * off, **where) - rest)[first:] for sign in (1.0, -1.0))
        both = 0.5 * (up + down)[:n]
        most = float(np.max(np.abs(both))) or 1.0
        uneven = max(uneven, float(np.max(np.abs(up - down))) / most)
        columns.append(both / most)
        sizes.append(off / most)
    fading = np.exp(-FADING_TIME_CONSTANTS / n * np.arange(n))[:, None, None]
    whole, missed = realise_impulse_response(fading * np.stack(columns, axis=2))
    seen, driven = loop.counted[[0, 2, 3], None] * whole.C[:3], whole.B[:, -valves:] / np.array(sizes[-valves:])
    return (
        with_input_delay(
            DiscreteSystem(whole.A * math.exp(FADING_TIME_CONSTANTS / n), driven, seen, np.zeros((3, valves))), delay
        ),
        uneven,
        missed,
    )


def _valves(controller: Controller) -> int:
    return 2 if controller.values["C_TWO_VALVES"] > 0.5 else 1


@dataclass(frozen=True)
class _ControllerFunction:
    """The function of the controller along the readings and references of a run."""

    law: int
    numbers: list[float]
    base: Run

    def sample(self, k: int, off: Array | float, state: Array) -> Array:
        """Return the state after sample k with deviations of the readings (3,)."""
        s = state.tolist()
        x, p1, p2 = (self.base.log[k, LOGGED_READINGS] + off).tolist()
        operate(self.law, float(self.base.scenario.reference[k]), x, p1, p2, 0.0, 0.0, 0.0, s, self.numbers)
        return _align_delay_lines(np.array(s))

    def state_before(self, k: int) -> Array:
        """Return the state before sample k, from the start on."""
        state = np.zeros(layout.L_STATES)
        for i in range(k):
            state = self.sample(i, 0.0, state)
        return state

    def state_sensitivity(self, k: int, state: Array) -> Array:
        """Return how far each state moves from sample k on under perturbed readings."""
        rng, plain, most = np.random.default_rng(0), state, np.zeros(layout.L_STATES)
        for i in range(k, k + PERTURBED_SAMPLES):
            plain, state = (
                self.sample(i, 0.0, plain),
                self.sample(i, READING_PERTURBATION * rng.standard_normal(3), state),
            )
            most = np.maximum(most, np.abs(state - plain))
        return most


def _align_delay_lines(state: Array) -> Array:
    """Return a state with its ring buffers rotated, so that equal delays have equal indices at every sample."""
    turns = int(state[layout.S_LINE_INDEX])
    for ring in DELAY_LINES:
        places = slice(ring, ring + layout.DELAY_LINE_SAMPLES)
        state[places] = np.roll(state[places], -turns)
    state[layout.S_LINE_INDEX] = 0.0
    return state


def _linearise_controller(controller: Controller, base: Run, k: int) -> DiscreteSystem:
    """Return the controller at sample k of a run by perturbation, without the states that no reading moves."""
    function = _ControllerFunction(list(LAWS).index(controller.law), controller.vector().tolist(), base)
    state = function.state_before(k)
    sizes = STATE_STEP_RATIO * function.state_sensitivity(k, state)
    moved = np.flatnonzero(sizes > 0.0)
    commands = [layout.S_U1, layout.S_U2][: _valves(controller)]
    columns = []
    for place in moved:
        step = np.zeros(layout.L_STATES)
        step[place] = sizes[place]
        columns.append(
            (function.sample(k, 0.0, state + step) - function.sample(k, 0.0, state - step)) / 2 / sizes[place]
        )
    for off in np.diag(STATE_STEP_RATIO * READING_PERTURBATION):
        columns.append((function.sample(k, off, state) - function.sample(k, -off, state)) / 2 / off.max())
    whole, n = np.stack(columns, axis=1), moved.size
    return observable_part(DiscreteSystem(whole[moved, :n], whole[moved, n:], whole[commands, :n], whole[commands, n:]))


Complex = NDArray[np.complex128]

STROKE_FRACTIONS = (0.3, 0.5, 0.7)  # of the stroke
FREQUENCY_COUNT = 1200
MIN_FREQUENCY_RATIO = 0.05  # of the position loop's corner: what is slower is the way that the piston makes meanwhile
REAL_AXIS_TOLERANCE = 0.02  # rad off the real axis: at half the sampling rate, and at the low end, a ratio is real
COMMAND_LOOPS, POSITION_LOOP = ("command", "command 2"), "position"


@dataclass(frozen=True)
class LoopCut:
    """A cut loop at one operating point: place of the cut, return ratio over frequencies (rad/s), margins."""

    loop: str
    x: float
    speed: float
    frequency: Array
    ratio: Complex
    margins: LoopMargins


@dataclass(frozen=True)
class MarginAnalysis:
    """All cuts, the closed-loop poles (1/s) at each operating point (x, speed), and what was excluded.

    Attributes:
        sticking_points: Operating points (x, direction) without steady sliding, which have no margins.
        excluded_effects: Titles of effects without a small-signal response.

    """

    cuts: tuple[LoopCut, ...]
    poles: dict[tuple[float, float], Complex]
    sticking_points: tuple[tuple[float, float], ...]
    excluded_effects: tuple[str, ...]
    slow_pole_limit: float

    def is_unstable(self, point: tuple[float, float]) -> bool:
        """Whether the loop grows at an operating point faster than the piston leaves it."""
        return bool(np.max(self.poles[point].real) > self.slow_pole_limit)


def analyse_margins(
    model: Model,
    controller: Controller,
    setup: ClosedLoopSetup,
    corner: float,
) -> MarginAnalysis:
    """Return margins and poles at PLACES of the stroke in both directions; ``corner`` of the position loop in rad/s."""
    smoothed, left = without_nonsmooth_effects(model)
    cuts: list[LoopCut] = []
    poles, stuck = {}, []
    points = [(share * controller.values["C_STROKE"], way) for share in STROKE_FRACTIONS for way in (1.0, -1.0)]
    for x, way in points:
        if (one := linearise(smoothed, controller, setup, corner, x, way)) is None:
            stuck.append((x, way))
            continue
        cuts += cut_loops(one, MIN_FREQUENCY_RATIO * corner)
        poles[x, one.speed] = closed_loop_poles(one)
    return MarginAnalysis(tuple(cuts), poles, tuple(stuck), left, MIN_FREQUENCY_RATIO * corner)


def cut_loops(one: LinearisedLoop, lowest: float) -> list[LoopCut]:
    """Return the loop cut at each command and at the reading of the position, from ``lowest`` (rad/s) on."""
    frequency = np.geomspace(lowest, math.pi / one.period, FREQUENCY_COUNT)
    z = np.exp(1j * frequency * one.period)
    P, C = one.axis.transfer_matrix(z), one.controller.transfer_matrix(z)
    ratios = {name: return_ratio(-C @ P, i) for i, name in enumerate(COMMAND_LOOPS[: C.shape[1]])} | {
        POSITION_LOOP: return_ratio(-P @ C, 0)
    }
    return [LoopCut(n, one.x, one.speed, frequency, L, stability_margins(frequency, L)) for n, L in ratios.items()]


def return_ratio(loops: NDArray[Any], i: int) -> Complex:
    """Return the return ratio of loop i of several (n, m, m) with the others closed: ``1 + L = det / det of these``."""
    whole, others = np.eye(loops.shape[1]) + loops, np.delete(np.arange(loops.shape[1]), i)
    return np.asarray(np.linalg.det(whole) / np.linalg.det(whole[:, others][:, :, others]) - 1.0)


def stability_margins(frequency: Array, L: Complex) -> LoopMargins:
    """Return the margins of a return ratio over frequencies (rad/s), with linear interpolation."""
    size, angle = np.log(np.abs(L)), np.unwrap(np.angle(-L))  # of -L, which is 0 where L lies on the negative axis
    at_one = _crossings(size)
    phases = np.array([_interpolate(angle, i, w) for i, w in at_one])
    speeds = np.array([_interpolate(frequency, i, w) for i, w in at_one])
    sizes = np.exp([_interpolate(size, i, w) for i, w in _phase_crossovers(angle)])
    near = (phases + math.pi) % (2.0 * math.pi) - math.pi
    return LoopMargins(
        gain_up=float(np.min(1.0 / sizes[sizes < 1.0], initial=math.inf)),
        gain_down=float(np.max(1.0 / sizes[sizes >= 1.0], initial=0.0)),
        phase=float(np.min(np.abs(near), initial=math.pi)),
        delay=float(np.min(phases % (2.0 * math.pi) / speeds, initial=math.inf)),
        modulus=float(np.min(np.abs(1.0 + L))),
        crossover=float(np.max(speeds)) if speeds.size else math.nan,
    )


def _phase_crossovers(angle: Array) -> list[tuple[int, float]]:
    """Return where L crosses the negative axis, or an end of the band that is close to it."""
    turn = 2.0 * math.pi
    first, last = int(angle.min() // turn), int(angle.max() // turn) + 1
    found = [place for k in range(first, last + 1) for place in _crossings(angle - turn * k)]
    ends = ((0, 0.0, angle[0]), (angle.size - 2, 1.0, angle[-1]))
    return found + [(i, w) for i, w, a in ends if abs(math.remainder(a, turn)) < REAL_AXIS_TOLERANCE]


def _crossings(values: Array) -> list[tuple[int, float]]:
    """Return where values cross 0: the sample before, and the fraction to the next."""
    places = np.flatnonzero((values[:-1] < 0.0) != (values[1:] < 0.0))
    return [(int(i), float(values[i] / (values[i] - values[i + 1]))) for i in places]


def _interpolate(values: Array, i: int, share: float) -> float:
    return float(values[i] + share * (values[i + 1] - values[i]))


def closed_loop_matrix(one: LinearisedLoop) -> Array:
    """Return the matrix of the closed loop: states of the axis, then those of the controller."""
    axis, law = one.axis, one.controller
    return np.block([[axis.A + axis.B @ law.D @ axis.C, axis.B @ law.C], [law.B @ axis.C, law.A]])


def closed_loop_poles(one: LinearisedLoop) -> Complex:
    """Return the closed-loop poles in 1/s, slowest first, without those that decay within a sample."""
    z = np.linalg.eigvals(closed_loop_matrix(one)).astype(complex)
    s = np.log(z[np.abs(z) > math.exp(-math.pi)]) / one.period
    return np.asarray(s[np.argsort(np.abs(s))])
