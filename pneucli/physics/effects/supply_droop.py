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
        Parameter(
            "vessel_volume",
            "m^3",
            None,
            "0.1 chamber volumes",
            "1e4 chamber volumes",
            ("4 chamber volumes", "16 chamber volumes"),
            "buffer volume",
        ),
        Parameter(
            "regulator_conductance",
            "kg/(s Pa)",
            math.inf,
            "0.02 valve conductances",
            "2e4 valve conductances",
            ("2 valve conductances", "12 valve conductances"),
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
