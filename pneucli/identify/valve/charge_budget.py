"""The uncertainty of C, b and m of charge and discharge tests."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from pneucli.identify.estimation.fit import Estimate
from pneucli.identify.valve.iso6358 import Characteristic, IsoConductance, thermal_state_is_known
from pneucli.identify.valve.result import ValveIdentification, known_vessel_volume
from pneucli.identify.valve.thermal_state import Vessel, thermal_range
from pneucli.identify.valve.uncertainty import (
    DEFAULT_RELATIVE_VOLUME,
    Budget,
    Contribution,
    Measurement,
    positive_interval,
)
from pneucli.quantities import Z95
from pneucli.recording import Calibration
from pneucli.simulate.model import Model

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
    budgets: list[Budget] = []
    iso: list[IsoConductance] = []
    for one in valve.iso:
        if _has_interval(one.C):
            budgets.append(budget_of_conductance(valve, one, measurement, fitted_volume=fitted_volume))
            one = replace(one, C=Characteristic(one.C.value, *budgets[-1].interval))  # noqa: PLW2901
        budgets += _budgets_of_curve(valve, one)
        iso.append(one)
    return replace(valve, iso=tuple(iso), budgets=tuple(budgets))


def _has_interval(c: Characteristic) -> bool:
    """Return whether the fit knows how far C may be off; an area at its bound has no interval."""
    return 0.0 < c.low < c.high < math.inf


def budget_of_conductance(
    valve: ValveIdentification, one: IsoConductance, measurement: Measurement, *, fitted_volume: bool
) -> Budget:
    """Return the budget of C of a path whose interval is that of the curves' scatter."""
    model, c = valve.area_model.model_gradient.model, one.C
    fills = one.u > 0.0
    relative = (math.log(c.high) - math.log(c.low)) / (2.0 * Z95)
    scatter = Contribution("scatter of the curves", "A", relative * c.value, UNIT, 1.0)
    stated = [*_geometry(model, c.value, measurement, fitted_volume=fitted_volume)]
    for signal in USED_SIGNALS[fills]:
        if (calibration := measurement.calibrations.get(signal)) is not None:
            stated += _sensor(signal, calibration, c.value, valve.area_model.supply, fills=fills)
    rest = math.hypot(*(part.contribution / c.value for part in (scatter, *stated)))
    factors = _thermal_factors(model, c.value, valve.area_model.supply, fills=fills)
    thermal = []
    if factors != (1.0, 1.0):
        width = (factors[1] - factors[0]) / math.sqrt(12.0)  # of a rectangle
        thermal = [Contribution("thermal state", "B", width, "1", c.value, factors)]
    missing = tuple(s for s in USED_SIGNALS[fills] if s not in measurement.calibrations)
    return Budget(
        f"{valve.label}.sonic_conductance({one.u:+.4g} V)",
        c.value,
        UNIT,
        (scatter, *stated, *thermal),
        positive_interval(c.value, rest, factors),
        missing,
    )


def _geometry(model: Model, c: float, measurement: Measurement, *, fitted_volume: bool) -> Iterator[Contribution]:
    """Yield volume and temperature: C goes with V and with the root of 1 / T."""
    volume, temperature = known_vessel_volume(model), model.base_values()["rig.gas_temperature"]
    if volume is not None and not fitted_volume:  # an identified volume is part of the scatter
        sigma = DEFAULT_RELATIVE_VOLUME * volume if measurement.volume_sigma is None else measurement.volume_sigma
        yield Contribution("volume of the vessel", "B", sigma, "m^3", c / volume)
    yield Contribution("gas temperature", "B", measurement.temperature_sigma, "K", -0.5 * c / temperature)


def _sensor(signal: str, calibration: Calibration, c: float, supply: float, *, fills: bool) -> Iterator[Contribution]:
    """Yield zero and gain of a pressure sensor.

    Of a path that fills, C = V dp1/dt / (n R T p_supply); of one that vents, p1 is upstream too and its gain cancels.
    """
    upstream = signal == "p_supply" or not fills
    if calibration.zero and upstream:
        yield Contribution(f"calibration of {signal}, zero", "B", calibration.zero, "Pa", -c / supply)
    if calibration.gain and fills:
        yield Contribution(f"calibration of {signal}, gain", "B", calibration.gain, "1", -c if upstream else c)


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
    least, largest = thermal_range(vessel, c, fills=fills)
    return least, largest if volume is not None else vessel.kappa  # without a volume all heat is possible


def _budgets_of_curve(valve: ValveIdentification, one: IsoConductance) -> Iterator[Budget]:
    """Yield the budgets of b and m as the measured curve shows them: its noise, and the drift of the thermal state."""
    for letter, name in (("b", "critical_ratio"), ("m", "subsonic_index")):
        figure: Characteristic = getattr(one, letter)
        if figure.measured is None or figure.parts is None:
            continue
        value, low, high = figure.measured
        noise, drift = figure.parts
        sources = [Contribution("scatter of the curve", "A", noise, "1", 1.0)]
        if drift > 0.0:
            sources.append(Contribution("drift of the thermal state", "B", drift, "1", 1.0))
        full_name = f"{valve.label}.{name}_of_curve({one.u:+.4g} V)"
        yield Budget(full_name, value, "1", tuple(sources), (low, high))
