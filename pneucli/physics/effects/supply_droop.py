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
    """Return the supply pressure after a step: a buffer vessel behind a linear regulator, by the backward Euler method.

    Args:
        p: Supply pressure of the base model in Pa.
        s: State, the pressure of the vessel in Pa; 0 before the first step.
        p_set: Set pressure of the regulator in Pa.
        q: Mass flow drawn in kg/s.
        k_gas: kappa R T of the gas in J/kg.
        h: Step in s.
        vessel_volume: Volume of the vessel in m^3.
        regulator_conductance: Mass flow of the regulator over its pressure difference in kg/(s Pa).

    Returns:
        Supply pressure at the valve in Pa, and the new state.

    >>> supply(7e5, 0.0, 7e5, 0.0, 1.18e5, 1e-3, 1e-3, 1e-7)
    (700000.0, 700000.0)
    >>> round(supply(7e5, 7e5, 7e5, 0.01, 1.18e5, 1e-3, 1e-3, 1e-7)[0])
    698834
    """
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
    source=(
        "lumped buffer vessel behind a proportional regulator; the line from stall to free flow of a pump before a "
        "vessel; suction over vacuum of an ejector, whose supply pressure is its end vacuum (data sheets)"
    ),
)
