"""Leak of chamber 1 to ambient."""

from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.gas import orifice_flow


def leak_1_ambient(p1: float, p_amb: float, k: float, area: float) -> float:
    """Return the mass flow of a leak out of chamber 1: an orifice with the critical ratio 0.528.

    Args:
        p1: Pressure of chamber 1 in Pa.
        p_amb: Ambient pressure in Pa.
        k: Flow constant of the gas in s/m.
        area: Effective area of the leak in m^2.

    Returns:
        Mass flow in kg/s.

    References:
        Thesis (2.46).

    >>> round(1e6 * leak_1_ambient(6e5, 1e5, 4.876e-3, 1e-8), 2)
    14.16
    """
    return area * orifice_flow(p1, p_amb, 0.528, k, k)


EFFECT = Effect(
    name="chamber-leak",
    title="Leak of chamber 1 to ambient",
    part="chamber",
    parameters=(
        Parameter("area", "m^2", 0.0, 0.0, "5 valve areas", ("0.01 valve areas", "0.05 valve areas"), "leak area"),
    ),
    ports={"leak_1_ambient": leak_1_ambient},
    equation="$q = A\\, p_1 \\sqrt{2/(R T)}\\, \\Psi'(p_{amb}/p_1)$, leaving chamber 1.",
    looks_like=(
        "The pressure falls while the valve is shut, the faster the higher it is; charging looks weaker "
        "and discharging stronger than the valve's map says."
    ),
    shows_over="p1",
    twins=("heat-transfer", "valve-leak", "piston-leak"),
    separate="Shut the valve at high pressure and hold for 30 s or longer; repeat at a second pressure.",
    source="ISO 6358-1; thesis 2.46",
)
