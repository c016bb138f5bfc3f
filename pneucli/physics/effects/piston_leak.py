"""Leak across the piston."""

from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.gas import orifice_flow


def leak_1_2(p1: float, p2: float, k: float, area: float) -> float:
    """Return the mass flow across the piston: an orifice with the critical ratio 0.528.

    Args:
        p1: Pressure of chamber 1 in Pa.
        p2: Pressure of chamber 2 in Pa.
        k: Flow constant of the gas in s/m.
        area: Effective area of the leak in m^2.

    Returns:
        Mass flow from chamber 1 to chamber 2 in kg/s.

    References:
        Thesis (2.46), applied to the seal of the piston.

    >>> leak_1_2(3e5, 3e5, 4.876e-3, 1e-8)
    0.0
    """
    return area * orifice_flow(p1, p2, 0.528, k, k)


EFFECT = Effect(
    name="piston-leak",
    title="Leak across the piston",
    part="cylinder",
    parameters=(
        Parameter("area", "m^2", 0.0, 0.0, "5 valve areas", ("0.01 valve areas", "0.05 valve areas"), "leak area"),
    ),
    ports={"leak_1_2": leak_1_2},
    equation="$q_{12} = A\\, p_1 \\sqrt{2/(R T)}\\, \\Psi'(p_2/p_1)$ from the higher to the lower pressure.",
    looks_like=(
        "The pressures of both chambers creep toward each other; a closed chamber 2 does not come back to "
        "its old pressure at the same position."
    ),
    shows_over="p2",
    twins=("chamber-leak", "heat-transfer"),
    separate="Hold the piston with a pressure difference for 30 s with both chambers shut.",
    source="thesis 2.46 applied to the piston seal",
)
