"""Uncertainty of C, b, m and cracking pressure: charge tests (ISO 6358-2) and steady benches, by JCGM 100."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pneucli.arrays import Array
from pneucli.figure import Figure
from pneucli.identify.estimation.fit import Estimate
from pneucli.identify.valve.flow_bench import FlowBench
from pneucli.identify.valve.identification import ValveIdentification, known_vessel_volume
from pneucli.identify.valve.iso6358 import IsoConductance, thermal_state_is_known
from pneucli.identify.valve.steady_flow import refit
from pneucli.identify.valve.steady_rows import FlowPath, FlowRows, coordinates_of
from pneucli.identify.valve.uncertainty import (
    COVERAGE_FACTOR,
    DEFAULT_RELATIVE_VOLUME,
    Measurement,
    budget_from,
    contribution,
    positive_interval,
)
from pneucli.messages.identify import Budget, Source
from pneucli.physics.iso_flow import REFERENCE_DENSITY, REFERENCE_TEMPERATURE
from pneucli.quantities import Z95
from pneucli.recording import Calibration
from pneucli.simulate.model import Model

MAX_HEAT_TRANSFER = 100.0  # W/(m^2 K): four times the most of free convection of gases (25), for a jet that stirs
CRITICAL_RATIO = 0.528  # of the curve whose shape is compared; another one moves the range by less than 0.01
SHARE_OF_CURVE = 0.9  # of the change of pressure that is compared
POINTS = 60


@dataclass(frozen=True)
class Vessel:
    """A vessel at a valve: pressures in Pa, temperature in K, gas constant in J/(kg K), volume in m^3."""

    volume: float
    supply: float
    ambient: float
    temperature: float
    kappa: float
    gas_constant: float

    @property
    def wall(self) -> float:
        """Wall of a cube of the volume in m^2."""
        return 6.0 * math.cbrt(self.volume) ** 2

    @property
    def charged_temperature(self) -> float:
        """Temperature in K at the end of a charge from ambient pressure without heat to the wall.

        It is the balance of energy over the charge: kappa T_0 / (1 + (kappa - 1) p_ambient / p_supply).
        """
        return self.kappa * self.temperature / (1.0 + (self.kappa - 1.0) * self.ambient / self.supply)


UNIT = "m^3/(s Pa)"
USED_SIGNALS = {True: ("p1", "p_supply"), False: ("p1",)}  # by whether the path fills the chamber


def with_budgets(
    valve: ValveIdentification, estimates: tuple[Estimate, ...], measurement: Measurement
) -> ValveIdentification:
    """Return the valve with a budget for C of each command, and the interval of C that follows.

    Args:
        valve: The identified valve; the interval of its C is that of the scatter.
        estimates: The parameters of the fit.
        measurement: What is known of the instruments.

    Returns:
        The valve.
    """
    fitted_volume = any(one.name == "rig.vessel_volume" for one in estimates)
    budgets = {
        one.u: budget_of_conductance(valve, one, measurement, fitted_volume=fitted_volume)
        for one in valve.iso
        if _has_interval(one.C)
    }
    iso = tuple(replace(one, C=budgets[one.u].figure) if one.u in budgets else one for one in valve.iso)
    named = {f"{valve.label}.sonic_conductance({u:+.4g} V)": own for u, own in budgets.items()}
    return replace(valve, iso=iso, budgets=named)


def _has_interval(c: Figure) -> bool:
    """Return whether the fit knows how far C may be off; an area at its bound has no interval."""
    return 0.0 < c.low < c.high < math.inf


def budget_of_conductance(
    valve: ValveIdentification, one: IsoConductance, measurement: Measurement, *, fitted_volume: bool
) -> Budget:
    """Return the budget of C of a path whose interval is that of the curves' scatter."""
    model, c = valve.model_gradient.model, one.C
    fills = one.u > 0.0
    relative = (math.log(c.high) - math.log(c.low)) / (2.0 * Z95)
    scatter = contribution("scatter of the curves", "A", relative * c.value, UNIT, 1.0)
    stated = [*_geometry(model, c.value, measurement, fitted_volume=fitted_volume)]
    for signal in USED_SIGNALS[fills]:
        if (calibration := measurement.calibrations.get(signal)) is not None:
            stated += _sensor(signal, calibration, c.value, valve.model_gradient.supply, fills=fills)
    rest = math.hypot(*(part.contribution / c.value for part in (scatter, *stated)))
    factors = _thermal_factors(model, c.value, valve.model_gradient.supply, fills=fills)
    thermal = []
    if factors != (1.0, 1.0):
        width = (factors[1] - factors[0]) / math.sqrt(12.0)  # of a rectangle
        thermal = [contribution("thermal state", "B", width, "1", c.value, factors)]
    missing = tuple(s for s in USED_SIGNALS[fills] if s not in measurement.calibrations)
    figure = Figure(c.value, *positive_interval(c.value, rest, factors), UNIT)
    return budget_from(figure, (scatter, *stated, *thermal), missing)


def _geometry(model: Model, c: float, measurement: Measurement, *, fitted_volume: bool) -> Iterator[Source]:
    """Yield volume and temperature: C goes with V and with the root of 1 / T."""
    volume, temperature = known_vessel_volume(model), model.base_values()["rig.gas_temperature"]
    if volume is not None and not fitted_volume:  # an identified volume is part of the scatter
        sigma = DEFAULT_RELATIVE_VOLUME * volume if measurement.volume_sigma is None else measurement.volume_sigma
        yield contribution("volume of the vessel", "B", sigma, "m^3", c / volume)
    yield contribution("gas temperature", "B", measurement.temperature_sigma, "K", -0.5 * c / temperature)


def _sensor(signal: str, calibration: Calibration, c: float, supply: float, *, fills: bool) -> Iterator[Source]:
    """Yield zero and gain of a pressure sensor.

    Of a path that fills, C = V dp1/dt / (n R T p_supply); of one that vents, p1 is upstream too and its gain cancels.
    """
    upstream = signal == "p_supply" or not fills
    if calibration.zero and upstream:
        yield contribution(f"calibration of {signal}, zero", "B", calibration.zero, "Pa", -c / supply)
    if calibration.gain and fills:
        yield contribution(f"calibration of {signal}, gain", "B", calibration.gain, "1", -c if upstream else c)


def _thermal_factors(model: Model, c: float, supply: float, *, fills: bool) -> tuple[float, float]:
    """Return by what C may have to be multiplied for the heat of the wall; 1 where the model says how much there is."""
    if thermal_state_is_known(model):
        return 1.0, 1.0
    base, volume = model.base_values(), known_vessel_volume(model)
    vessel = Vessel(
        volume or 1.0,
        supply,
        base["rig.ambient_pressure"],
        base["rig.gas_temperature"],
        base["rig.heat_capacity_ratio"],
        base["rig.gas_constant"],
    )
    least, largest = _thermal_range(vessel, c, fills=fills)
    return least, largest if volume is not None else vessel.kappa  # without a volume all heat is possible


def _thermal_range(vessel: Vessel, conductance: float, *, fills: bool) -> tuple[float, float]:
    """Return by what C may have to be multiplied for heat between gas and wall.

    >>> vessel = Vessel(160e-6, 7e5, 1e5, 293.15, 1.4, 287.0)
    >>> [round(factor, 2) for factor in _thermal_range(vessel, 3.6e-9, fills=True)]
    [1.0, 1.11]
    >>> [round(factor, 2) for factor in _thermal_range(vessel, 4e-11, fills=True)]
    [1.0, 1.39]
    >>> [round(factor, 2) for factor in _thermal_range(vessel, 3.6e-9, fills=False)]
    [0.93, 1.21]
    """
    states = [(0.0, vessel.temperature), (MAX_HEAT_TRANSFER, vessel.temperature)]
    if not fills:  # gas that a charge has warmed keeps that temperature only where the wall takes no heat
        states.append((0.0, vessel.charged_temperature))
    factors = [conductance_factor(vessel, conductance, *state, fills=fills) for state in states]
    return min(factors), max(factors)


def conductance_factor(vessel: Vessel, conductance: float, heat_transfer: float, start: float, *, fills: bool) -> float:
    """Return the true C over the one with which the adiabatic model fits the curve best.

    Args:
        vessel: The vessel.
        conductance: True C in m^3/(s Pa).
        heat_transfer: Coefficient of the wall in W/(m^2 K).
        start: Temperature of the gas at the start in K.
        fills: Whether the path fills the vessel.
    """
    from scipy.integrate import solve_ivp  # noqa: PLC0415 - slow to import, and few valve tests show heat
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - slow to import, and few valve tests show heat

    begin, end = (vessel.ambient, vessel.supply) if fills else (vessel.supply, vessel.ambient)
    unit = vessel.volume / (conductance * REFERENCE_DENSITY * vessel.gas_constant * vessel.temperature)  # s
    target = begin + SHARE_OF_CURVE * (end - begin)

    def arrived(_: float, state: Array) -> float:
        return float(state[0] - target)

    arrived.terminal = True  # type: ignore[attr-defined]
    rates = _rates(vessel, conductance, heat_transfer, fills=fills)
    true = solve_ivp(rates, (0.0, 100.0 * unit), [begin, start], "LSODA", events=arrived, dense_output=True, rtol=1e-6)
    time = np.linspace(0.0, true.t[-1], POINTS)
    assert true.sol is not None  # as dense_output asks for
    measured = true.sol(time)[0]
    model = solve_ivp(
        _rates(vessel, conductance, None, fills=fills), (0.0, 2.0 * time[-1]), [begin, vessel.temperature], "LSODA",
        t_eval=np.linspace(0.0, 2.0 * time[-1], 10 * POINTS), rtol=1e-6,
    )  # fmt: skip

    def misfit(scale: float) -> float:  # the model's pressure is a function of C t
        return float(np.sum((np.interp(scale * time, model.t, model.y[0]) - measured) ** 2))

    return 1.0 / float(minimize_scalar(misfit, bounds=(0.5, 1.5), method="bounded").x)


def _rates(
    vessel: Vessel, conductance: float, heat_transfer: float | None, *, fills: bool
) -> Callable[[float, Array], Array]:
    """Return d(p, T)/dt of the vessel; without a coefficient of heat transfer those of the adiabatic model."""
    kappa, gas, inlet = vessel.kappa, vessel.gas_constant, vessel.temperature
    unit = conductance * REFERENCE_DENSITY * math.sqrt(REFERENCE_TEMPERATURE)

    def rates(_: float, state: Array) -> Array:
        p, T = float(state[0]), float(state[1])
        if fills:
            flow, carried = unit / math.sqrt(inlet) * vessel.supply * _subsonic(p / vessel.supply), inlet
        else:
            flow, carried = -unit / math.sqrt(T) * p * _subsonic(vessel.ambient / p), T
        if heat_transfer is None:
            return np.array([kappa * gas * carried * flow / vessel.volume, 0.0])
        c_v = gas / (kappa - 1.0)
        power = kappa * c_v * carried * flow + heat_transfer * vessel.wall * (inlet - T)
        mass = p * vessel.volume / (gas * T)
        return np.array([(kappa - 1.0) * power / vessel.volume, (power - c_v * T * flow) / (mass * c_v)])

    return rates


def _subsonic(ratio: float) -> float:
    """Return the flow over its choked value."""
    return math.sqrt(max(1.0 - (max(min(ratio, 1.0) - CRITICAL_RATIO, 0.0) / (1.0 - CRITICAL_RATIO)) ** 2, 0.0))


Move = Callable[[FlowRows, float], FlowRows]
FIGURES = (
    ("sonic_conductance", "C", "m^3/(s Pa)"),
    ("critical_ratio", "b", "1"),
    ("subsonic_index", "m", "1"),
    ("cracking_pressure", "cracking", "Pa"),
)
SIGNALS = ("p_supply", "p1", "flow", "temperature")
ENDS = {"forward": ("p_supply", "p1"), "reverse": ("p1", "p_supply"), "to ambient": ("p1", None)}  # up, down


def with_flow_budgets(
    bench: FlowBench, label: Callable[[FlowPath], str], measurement: Measurement, recorded: Sequence[str]
) -> FlowBench:
    """Return the bench with a budget for each characteristic, and the intervals that follow.

    Args:
        bench: The fitted bench; its intervals are those of the scatter.
        label: The end of a path's names.
        measurement: What is known of the instruments.
        recorded: Signals that were recorded.

    Returns:
        The bench.
    """
    paths, budgets = [], dict[str, Budget]()
    for path in bench.paths:
        own = _path_budgets(path, bench, measurement, recorded)
        budgets |= {f"valve.{name}{label(path)}": own[letter] for name, letter, _ in FIGURES if letter in own}
        changed = {
            letter: replace(getattr(path, letter), low=b.figure.low, high=b.figure.high) for letter, b in own.items()
        }
        paths.append(replace(path, **changed))
    return replace(bench, paths=tuple(paths), budgets=budgets)


def _path_budgets(
    path: FlowPath, bench: FlowBench, measurement: Measurement, recorded: Sequence[str]
) -> dict[str, Budget]:
    """Return the budget of each characteristic by its letter."""
    moved = [
        (source, uncertainty, unit, _change(path, bench, move, uncertainty))
        for source, uncertainty, unit, move in _inputs(path, bench, measurement, recorded)
    ]
    missing = tuple(s for s in SIGNALS if s in recorded and s not in measurement.calibrations)
    found = {}
    for i, (_, letter, unit) in enumerate(FIGURES):
        figure: Figure | None = getattr(path, letter)
        if figure is None:
            continue
        sources = [_scatter(path, i, figure, unit)]
        if figure.determined:  # what the rows do not determine no gauge changes
            sources += [contribution(s, "B", u, own, change[i] / u) for s, u, own, change in moved if change[i]]
        known = Figure(figure.value, *_interval(i, figure, sources), unit)
        found[letter] = budget_from(known, sources, missing)
    return found


def _scatter(path: FlowPath, i: int, figure: Figure, unit: str) -> Source:
    """Return the contribution of the rows' scatter: k times it has 95 % of Student's t."""
    scale = path.C.value if i == 0 else 1.0
    uncertainty = path.quantile / COVERAGE_FACTOR * math.sqrt(max(path.covariance[i, i], 0.0)) * scale
    if figure.determined and (i < 3 or uncertainty > 0.0):
        return contribution("scatter of the rows", "A", uncertainty, unit, 1.0)
    if not figure.determined:
        return contribution("typical values of valves", "B", uncertainty, unit, 1.0)
    between = (figure.high - figure.low) / math.sqrt(12.0)
    return contribution("between shut and open rows", "B", between, unit, 1.0)


def _interval(i: int, figure: Figure, sources: Sequence[Source]) -> tuple[float, float]:
    """Return the value with its expanded uncertainty; what the fit found one-sided stays so, and grows."""
    own, rest = sources[0], math.hypot(*(one.contribution for one in sources[1:]), 0.0)
    if i == 0:
        return positive_interval(figure.value, math.hypot(own.contribution, rest) / figure.value)
    below, above = (math.hypot(abs(end - figure.value), COVERAGE_FACTOR * rest) for end in (figure.low, figure.high))
    return max(figure.value - below, 0.0), min(figure.value + above, 1.0 if i == 1 else math.inf)


def _inputs(
    path: FlowPath, bench: FlowBench, measurement: Measurement, recorded: Sequence[str]
) -> Iterator[tuple[str, float, str, Move]]:
    """Yield source, standard uncertainty, its unit, and how it moves the rows."""
    for signal in SIGNALS:
        calibration = measurement.calibrations.get(signal)
        if calibration is None or signal not in recorded:
            continue
        origin = bench.rig.ambient_pressure if signal in measurement.gauge else 0.0
        unit = {"flow": "kg/s", "temperature": "K"}.get(signal, "Pa")
        if calibration.zero:
            yield f"calibration of {signal}, zero", calibration.zero, unit, _mover(path, signal, _shifted)
        if calibration.gain:
            move = _mover(path, signal, partial(_scaled, origin=origin))
            yield f"calibration of {signal}, gain", calibration.gain, "1", move
    if "temperature" not in recorded:
        yield "gas temperature", measurement.temperature_sigma, "K", _mover(path, "temperature", _shifted)


def _shifted(reading: Array, by: float) -> Array:
    return reading + by


def _scaled(reading: Array, by: float, origin: float) -> Array:
    """Return a reading with another gain, which acts on what the sensor reads above its origin."""
    return reading + by * (reading - origin)


def _mover(path: FlowPath, signal: str, change: Callable[[Array, float], Array]) -> Move:
    """Return what changes one signal of the rows of a path."""
    up, down = ENDS[path.rows.direction]

    def moved(rows: FlowRows, by: float) -> FlowRows:
        changed = {name: change(getattr(rows, name), by) for name in ("upstream", "downstream", "flow", "temperature")}
        return replace(
            rows,
            upstream=changed["upstream"] if up == signal else rows.upstream,
            downstream=changed["downstream"] if down == signal else rows.downstream,
            flow=changed["flow"] if signal == "flow" else rows.flow,
            temperature=changed["temperature"] if signal == "temperature" else rows.temperature,
        )

    return moved


def _change(path: FlowPath, bench: FlowBench, move: Move, by: float) -> Array:
    """Return half of the change of (C, b, m, cracking pressure) from one side of an input to the other."""
    ends = []
    for side in (by, -by):
        at = coordinates_of(refit(path, move(path.rows, side), bench.law))
        at[0] = math.exp(at[0])
        ends.append(at)
    return np.asarray(0.5 * (ends[0] - ends[1]))
