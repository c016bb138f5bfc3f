"""Supply pressure that falls with the flow drawn."""

import math

from pneucli.physics.declaration import Effect, Parameter


def supply(
    p: float,
    s: float,
    p_set: float,
    q: float,
    k_gas: float,
    h: float,
    vessel_volume: float,
    regulator_conductance: float,
) -> tuple[float, float]:
    """Supply pressure in Pa after a step h: buffer vessel behind a linear regulator (backward Euler)."""
    if s <= 0.0:
        s = p_set
    gain = h * k_gas / vessel_volume
    s = (s + gain * (regulator_conductance * p_set - q)) / (1.0 + gain * regulator_conductance)
    return s, s


EFFECT = Effect(
    name="supply-droop",
    title="Supply pressure that falls with the flow drawn",
    part="supply",
    parameters=(
        Parameter("vessel_volume", "m^3", None, 1e-5, 1.0, (5e-4, 2e-3), "buffer volume"),
        Parameter(
            "regulator_conductance",
            "kg/(s Pa)",
            math.inf,
            1e-10,
            1e-4,
            (1e-8, 5e-8),
            "flow per pressure drop of the regulator",
        ),
    ),
    ports={"supply": supply},
    equation="$\\dot p_S = \\frac{\\kappa R T}{V_b}\\left(G (p_{set} - p_S) - q\\right)$",
    looks_like=(
        "Charging slows at large commands as if the valve were smaller, and recovers with a delay; discharging fits."
    ),
    shows_over="u",
    twins=("critical-ratio",),
    separate="Record the supply pressure at the valve.",
    source="lumped buffer vessel behind a proportional regulator",
)
