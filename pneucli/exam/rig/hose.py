"""A hose between valve and chamber as a line of segments: volume, inertia and friction of each."""

from __future__ import annotations

import math

from pneucli.arrays import Array
from pneucli.caches import compiled, part
from pneucli.exam.rig.gas import GAS_CONSTANT
from pneucli.exam.rig.parameters import ONE_CHAMBER, Parameters

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
