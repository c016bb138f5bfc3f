"""Figures of a closed-loop run, in SI unless the name has a unit, and laws side by side by them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.caches import compiled
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, Scenario, simulate
from pneucli.controller import layout
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.design.effect_compensation import critical_ratio
from pneucli.physics.gas import flow_constant
from pneucli.physics.vectorised import flow_functions
from pneucli.simulate import layout as at
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
MIN_SLIDING_SHARE = (
    0.8  # below it, with more than 20 % of the samples at the bound, the estimate is no equivalent value
)
ROUNDING = 1e-6  # relative, of an increment at the bound
# by observed disturbance: column of the log, bound M_k, and the share of the feedback that the low-pass (5.20) adds
OBSERVERS = {
    "load": (layout.L_LOAD, "C_LOAD_STEP_MAX", "C_LOAD_FILTER"),
    "flow": (layout.L_FLOW1, "C_FLOW_STEP_MAX", "C_FLOW_FILTER"),
}

MICROMETRES_PER_METRE = 1e6
REST_WINDOW = 0.4  # s at the end of a stretch in which nothing changes, over which rest is judged
SETTLING_BAND = 50e-6  # m
PRESSURE_SETTLING_BAND = 0.02  # of a step of the pressure reference
CHATTERING_FREQUENCY = 50.0  # above it the command counts as chattering
MIN_REST_DURATION = 1.2  # s that a stretch without change lasts at least


def sliding_shares(run: Run, controller: Controller) -> dict[str, float]:
    """Return the share of samples in sliding mode of each disturbance observer.

    Args:
        run: A closed-loop run of the controller.
        controller: The controller; its law determines which observers exist.

    Returns:
        ``load`` and ``flow``, 0 to 1; NaN for an observer that the law does not have.

    References:
        Thesis (5.18) to (5.21): the filtered feedback is the disturbance only while the feedback is within M_k.

    """
    return {name: _share(run.log[:, column], _largest_increment(controller, bound, low_pass))
            for name, (column, bound, low_pass) in OBSERVERS.items()}  # fmt: skip


def _largest_increment(controller: Controller, bound: str, low_pass: str) -> float:
    """Return the increment of the estimate in a sample at the bound; NaN without such an observer."""
    law = LAWS[controller.law]
    if low_pass in law.constants:
        return controller.values[bound] * float(controller.vector()[law.constants[low_pass]])
    return controller.values[bound] if controller.values["C_DISTURBANCE_OBSERVERS"] > 0.5 else np.nan


def _share(estimate: Array, increment: float) -> float:
    if np.isnan(increment):
        return np.nan
    return float(np.mean(np.abs(np.diff(estimate)) < (1.0 - ROUNDING) * increment))


@dataclass(frozen=True)
class Metrics:
    """Figures of one run; NaN if the scenario does not show a figure.

    Attributes:
        steady_um: Largest error over the last 0.4 s of all segments with constant reference, load and supply.
        cycle_um: Largest range of x there.
        tracking_rms_um: Error while the reference moves smoothly, rms from 1 s on.
        tracking_max_um: The same, largest value.
        overshoot_um: Largest overshoot of all steps of the reference.
        rise_s: Longest rise time, 10 to 90 %.
        settling_s: Longest settling time to 50 um.
        recovery_s: Longest time after a change of load until the error stays within 50 um.
        peak_um: Largest error after a change of load.
        load_error: Estimated less true load over the largest true load.
        switching_hz: Reversals of u by more than 1 % of its range, per second.
        fast_share: Share of the variance of u above 50 Hz.
        fast_v: Rms of u above 50 Hz in V.
        air_kg: Air drawn from the supply.
        pressure_rest_pa: Largest error of pressure control at rest; runs of it have no figures of position.
        pressure_rms_pa: Rms error of pressure control.
        pressure_settling_s: Longest time of pressure control to within 2 % of a step.
        sliding_load: Share of samples in which the feedback of the load observer is within M_k.
        sliding_flow: The same of the flow observer.

    """

    steady_um: float = np.nan
    cycle_um: float = np.nan
    tracking_rms_um: float = np.nan
    tracking_max_um: float = np.nan
    overshoot_um: float = np.nan
    rise_s: float = np.nan
    settling_s: float = np.nan
    recovery_s: float = np.nan
    peak_um: float = np.nan
    load_error: float = np.nan
    switching_hz: float = np.nan
    fast_share: float = np.nan
    fast_v: float = np.nan
    air_kg: float = np.nan
    pressure_rest_pa: float = np.nan
    pressure_rms_pa: float = np.nan
    pressure_settling_s: float = np.nan
    sliding_load: float = np.nan
    sliding_flow: float = np.nan


def evaluate_run(run: Run, model: Model, controller: Controller) -> Metrics:
    """Return the figures of a run.

    Args:
        run: The run.
        model: The axis that was simulated; its valve gives the air.
        controller: The controller that ran.

    """
    s, time, x = run.scenario, run.time, run.model[:, at.X]
    if s.controls_pressure:
        return _pressure_metrics(run, model, controller)
    error = s.reference - x
    jumps = np.abs(np.diff(s.reference)) > 10.0 * controller.values["C_A_MAX"] * controller.period**2
    moving = np.concatenate([[False], (np.diff(s.reference) != 0.0) & ~jumps])
    rests = [r for r in _constant_segments(run, moving) if time[r.stop - 1] - time[r.start] >= MIN_REST_DURATION]
    ends = [slice(r.stop - round(REST_WINDOW / controller.period), r.stop) for r in rests]
    track = moving & (time >= 1.0) & ~np.isnan(error)
    steps = [_step_response(time[r], x[r], s.reference[r]) for r in rests if r.start > 0 and jumps[r.start - 1]]
    loads = [_recovery(time[r], error[r]) for r in rests if r.start > 0 and s.force[r.start] != s.force[r.start - 1]]
    fast, share = _chattering(run.log[:, layout.L_U1], controller.period)
    return Metrics(
        MICROMETRES_PER_METRE * _worst(float(np.max(np.abs(error[e]))) for e in ends),
        MICROMETRES_PER_METRE * _worst(float(np.ptp(x[e])) for e in ends),
        MICROMETRES_PER_METRE * float(np.sqrt(np.mean(error[track] ** 2))) if track.any() else np.nan,
        MICROMETRES_PER_METRE * float(np.max(np.abs(error[track]))) if track.any() else np.nan,
        MICROMETRES_PER_METRE * _worst(o for o, _, _ in steps),
        _worst(r for _, r, _ in steps),
        _worst(t for _, _, t in steps),
        _worst(t for t, _ in loads),
        MICROMETRES_PER_METRE * _worst(p for _, p in loads),
        _load_error(run, ends) if LAWS[controller.law].estimates_load else np.nan,
        _switching(run, controller),
        share,
        fast,
        air_consumption(run, model, controller),
        **_sliding(run, controller),
    )


def _sliding(run: Run, controller: Controller) -> dict[str, float]:
    return {f"sliding_{name}": share for name, share in sliding_shares(run, controller).items()}


def _pressure_metrics(run: Run, model: Model, controller: Controller) -> Metrics:
    """Return the figures of a run of pressure control."""
    error = run.scenario.reference - run.model[:, at.P1]
    rests = [
        r
        for r in _constant_segments(run, np.zeros(error.size, dtype=bool))
        if (r.stop - r.start) * controller.period > REST_WINDOW
    ]
    ends = [slice(r.stop - round(REST_WINDOW / controller.period), r.stop) for r in rests]
    fast, share = _chattering(run.log[:, layout.L_U1], controller.period)
    return Metrics(
        switching_hz=_switching(run, controller),
        fast_share=share,
        fast_v=fast,
        air_kg=air_consumption(run, model, controller),
        pressure_rest_pa=_worst(float(np.max(np.abs(error[e]))) for e in ends),
        pressure_rms_pa=float(np.sqrt(np.mean(error**2))),
        pressure_settling_s=_worst(_pressure_settling(run, r) for r in rests if r.start > 0),
        sliding_flow=_sliding(run, controller)["sliding_flow"],
    )


def _pressure_settling(run: Run, segment: slice) -> float:
    """Return the time in s after which a pressure stays in its settling band; infinite: never."""
    reference, p = run.scenario.reference, run.model[segment, at.P1]
    step = abs(reference[segment.start] - reference[segment.start - 1])
    return _settled(run.time[segment], np.abs(reference[segment] - p) > PRESSURE_SETTLING_BAND * step)


def _settled(time: Array, outside: Mask) -> float:
    """Return the time in s after which a signal stays inside; infinite: never."""
    off = np.flatnonzero(outside)
    return 0.0 if off.size == 0 else np.inf if off[-1] == time.size - 1 else float(time[off[-1] + 1] - time[0])


def _switching(run: Run, controller: Controller) -> float:
    """Return the reversals of u per second."""
    times = _reversals(run.log[:, layout.L_U1], 0.02 * controller.values["C_U_MAX"])
    return times / float(run.time[-1] - run.time[0])


def _worst(values: object) -> float:
    """Return the largest value; NaN without values."""
    return max(values, default=float("nan"))  # type: ignore[call-overload,no-any-return]


def _constant_segments(run: Run, moving: Mask) -> list[slice]:
    """Return the segments with constant reference, load and supply."""
    s = run.scenario
    change = moving.copy()
    for signal in (s.reference, s.force, s.supply):
        change[1:] |= np.diff(signal) != 0.0
    edges = [0, *np.flatnonzero(change), run.time.size]
    return [slice(a, b) for a, b in pairwise(edges) if b > a]


def _step_response(time: Array, x: Array, reference: Array) -> tuple[float, float, float]:
    """Return overshoot (m), rise time 10-90 % and settling time (s) of one step."""
    target, begin = reference[0], x[0]
    way = (x - begin) / (target - begin)
    overshoot = max(float(np.max(way)) - 1.0, 0.0) * abs(target - begin)
    if np.max(way) < 0.9:
        return overshoot, np.inf, np.inf
    rise = time[np.argmax(way >= 0.9)] - time[np.argmax(way >= 0.1)]
    return overshoot, float(rise), _recovery(time, target - x)[0]


def _recovery(time: Array, error: Array) -> tuple[float, float]:
    """Return the time in s after which the error stays within 50 um (infinite: never), and its peak in m."""
    return _settled(time, np.abs(error) > SETTLING_BAND), float(np.max(np.abs(error)))


def _load_error(run: Run, ends: list[slice]) -> float:
    """Return the worst difference of estimated and true load at rest, over the largest true load."""
    largest = float(np.max(np.abs(run.scenario.force)))
    if largest == 0.0:
        return float("nan")
    off = run.log[:, layout.L_LOAD] - run.scenario.force
    return _worst(abs(float(np.mean(off[e]))) / largest for e in ends)


@compiled(nogil=True)
def _reversals(u: Array, threshold: float) -> int:
    """Count reversals of u that are larger than a threshold (V)."""
    count, extreme, direction = 0, u[0], 0.0
    for value in u:
        if direction == 0.0:
            direction = np.sign(value - extreme)
        if direction * (value - extreme) > 0.0:
            extreme = value
        elif abs(value - extreme) > threshold:
            count, direction, extreme = count + 1, -direction, value
    return count


def _chattering(u: Array, period: float) -> tuple[float, float]:
    """Return rms (V) and share of the variance of u above 50 Hz."""
    from scipy.signal import welch  # noqa: PLC0415 - slow to import, and only closed loops have a spectrum

    frequency, power = welch(u, 1.0 / period, nperseg=min(1024, u.size))
    width, fast = frequency[1], frequency > CHATTERING_FREQUENCY
    total = float(np.sum(power) * width)
    high = float(np.sum(power[fast]) * width)
    return float(np.sqrt(high)), high / total if total > 0.0 else 0.0


def air_consumption(run: Run, model: Model, controller: Controller) -> float:
    """Return the gas in kg that the valves drew from the supply at the commands of the run (2.46)."""
    base = model.base_values()
    gas = (base[f"rig.{name}"] for name in ("gas_constant", "gas_temperature", "heat_capacity_ratio"))
    k, b = flow_constant(*gas), critical_ratio(model)
    null, total = base["valve.null"], 0.0
    second = null - run.log[:, layout.L_U1] if controller.values["C_MIRRORED"] > 0.5 else run.log[:, layout.L_U2] - null
    driven = controller.values["C_MIRRORED"] > 0.5 or controller.values["C_TWO_VALVES"] > 0.5
    sides = [(model.valve, run.log[:, layout.L_U1] - null, at.P1)] + [(model.chamber_2_valve, second, at.P2)] * driven
    for valve, opened, p in sides:
        ratio = np.minimum(run.model[:, p] / run.scenario.supply, 1.0)
        psi = flow_functions(ratio, b)
        area = np.where(opened > 0.0, valve(opened), 0.0)
        total += float(np.sum(area * run.scenario.supply * k * psi)) * float(run.time[1] - run.time[0])
    return total


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
