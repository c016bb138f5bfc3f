"""The gas of the rig: flow through openings and from a pump, leaks, a chamber with its walls, a hose in segments."""

import math

from pneucli.arrays import Array
from pneucli.caches import compiled, part
from pneucli.exam.rig.parameters import ONE_CHAMBER, Parameters

KAPPA = 1.4
GAS_CONSTANT = 287.0
PSI_MAX = 0.484
LEAK_RATIO = 0.528
VESSEL_SHAPE = 1.5 * math.pow(16.0 * math.pi, 1.0 / 3.0)  # walls over volume^(2/3) of a can as long as it is wide


@compiled()
def orifice_flow(area: float, p_up: float, t_up: float, p_down: float, ratio: float) -> float:
    """Mass flow in kg/s through an orifice (thesis 2.42, 2.46), zero against the pressure difference."""
    r = p_down / p_up
    if r >= 1.0:
        return 0.0
    psi = PSI_MAX
    if r > ratio:
        psi *= math.sqrt(1.0 - ((r - ratio) / (1.0 - ratio)) ** 2)
    return area * p_up * math.sqrt(2.0 / (GAS_CONSTANT * t_up)) * psi


@compiled()
def pump_flow(par: Parameters, opening: float, p: float) -> float:
    """Mass flow in kg/s of a pump: its speed goes with the command, its losses with the pressure that it works on."""
    above = max(p - par.ambient, 0.0)
    driven = par.pump_flow * max(opening, 0.0) / par.command_range * (1.0 - par.pump_clearance * above)
    return max(driven - par.pump_slip * above, 0.0)


@compiled()
def regulated_opening(par: Parameters, opening: float, p: float) -> float:
    """Opening in V that a valve with a pressure loop gives itself: proportional to the error of its pressure.

    Its ``opening`` asks for half of the span at the null, for none and for all of it at the ends of the range.
    """
    if par.regulated_span <= 0.0:
        return opening
    asked = par.ambient + par.regulated_span * 0.5 * (1.0 + opening / par.command_range)
    wanted = par.command_range * (asked - p) / par.regulated_band
    return float(min(max(wanted, -par.command_range), par.command_range))


@compiled()
def wall_area(piston_area: float, volume: float) -> float:
    """Area in m^2 of the walls of a chamber: both ends and the bore; of a vessel as long as it is wide."""
    if piston_area <= 0.0:
        return VESSEL_SHAPE * math.pow(volume, 2.0 / 3.0)
    return 2.0 * piston_area + math.sqrt(4.0 * math.pi / piston_area) * volume


@compiled()
def wall_conductance(par: Parameters, piston_area: float, volume: float) -> float:
    """Conductance in W/K between the gas of a chamber and its walls; below zero: constant temperature."""
    if par.wall_coefficient > 0.0:
        return par.wall_coefficient * wall_area(piston_area, volume)
    return par.heat_conductance


@part()
def chamber_rates(
    par: Parameters, p: float, t: float, volume: float, growth: float, q: float, heat: float, conductance: float
) -> tuple[float, float]:
    """Rates of p and T (Pa/s, K/s) from mass and energy.

    ``heat`` is the sum of q T over all flows in (kg K/s); a ``conductance`` (W/K) below zero keeps the temperature.
    """
    if conductance < 0.0:
        return KAPPA * (GAS_CONSTANT * par.temperature * q - p * growth) / volume, 0.0
    wall = (KAPPA - 1.0) * conductance * (par.temperature - t)
    dp = (KAPPA * (GAS_CONSTANT * heat - p * growth) + wall) / volume
    return dp, t * (dp / p + growth / volume - GAS_CONSTANT * t * q / (p * volume))


@part()
def relief_leak_area(par: Parameters, p: float, growth: float, opening: float) -> float:
    """Area in m^2 of a leak that opens with the pressure: by ``growth`` (m^2/Pa) above ``opening`` (Pa, gauge)."""
    return growth * max(p - par.ambient - opening, 0.0)


@part()
def laminar_leak_flow(par: Parameters, p: float, conductance: float) -> float:
    """Mass flow in kg/s through a long narrow gap: laminar, at the mean of the densities of both ends."""
    return conductance * (p - par.ambient) * 0.5 * (p / par.ambient + 1.0)


@part()
def leaks_1(par: Parameters, p: float, t: float) -> tuple[float, float]:
    """Mass flows in kg/s (ambient to chamber 1, chamber 1 to ambient) of its leaks."""
    area = par.leak_area + relief_leak_area(par, p, par.relief_growth, par.relief_pressure)
    lost = orifice_flow(area, p, t, par.ambient, LEAK_RATIO) + laminar_leak_flow(par, p, par.laminar_conductance)
    return orifice_flow(par.leak_area, par.ambient, par.temperature, p, LEAK_RATIO), lost


@part()
def leaks_2(par: Parameters, p: float, t: float) -> tuple[float, float]:
    """Mass flows in kg/s (ambient to chamber 2, chamber 2 to ambient) of its leaks."""
    area = par.leak_area_2 + relief_leak_area(par, p, par.relief_growth_2, par.relief_pressure_2)
    lost = orifice_flow(area, p, t, par.ambient, LEAK_RATIO) + laminar_leak_flow(par, p, par.laminar_conductance_2)
    return orifice_flow(par.leak_area_2, par.ambient, par.temperature, p, LEAK_RATIO), lost


SEGMENTS = 8
SPEED_OF_SOUND = 343.0  # m/s, by which a length is stated as a delay
EXPONENT = 1.2  # the hose's wall exchanges some heat: waves are slower than sound by 7 %
VISCOSITY = 1.8e-5  # Pa s


@compiled()
def hose_volume(par: Parameters, chamber: int) -> float:
    """Return the volume in m^3 of a chamber's hose; 0 where it only delays the flow, or no valve is there."""
    if par.hose_bore == 0.0 or (chamber == 1 and par.arrangement == ONE_CHAMBER):
        return 0.0
    return 0.25 * math.pi * par.hose_bore**2 * SPEED_OF_SOUND * par.line_delay


@part()
def flow_through_hose(par: Parameters, h: float, come: float, p: float, pressures: Array, flows: Array) -> float:
    """Advance a hose by h (s); return the mass flow in kg/s into a chamber at p (Pa).

    ``come`` (kg/s) is the flow of the valve; ``pressures`` and ``flows`` (SEGMENTS,) in Pa and kg/s are updated.
    """
    area, dx = 0.25 * math.pi * par.hose_bore**2, SPEED_OF_SOUND * par.line_delay / SEGMENTS
    rt = GAS_CONSTANT * par.temperature
    for i in range(SEGMENTS):
        after = pressures[i + 1] if i < SEGMENTS - 1 else p
        density = (pressures[i] if flows[i] > 0.0 else after) / rt
        speed = abs(flows[i]) / (density * area)
        reynolds = density * speed * par.hose_bore / VISCOSITY
        laminar = 32.0 * VISCOSITY / (density * par.hose_bore**2)
        friction = max(laminar, 0.158 * speed / par.hose_bore / max(reynolds, 1.0) ** 0.25)
        if i == SEGMENTS - 1:
            friction += 0.75 * speed / dx  # both ends are sharp
        flows[i] = (flows[i] + h * area / dx * (pressures[i] - after)) / (1.0 + h * friction)
    for i in range(SEGMENTS):
        pressures[i] = max(pressures[i] + h * EXPONENT * rt / (area * dx) * (come - flows[i]), 1e3)
        come = float(flows[i])
    return come
