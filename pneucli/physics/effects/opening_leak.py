"""Leak of chamber 1 that opens under pressure."""

from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.gas import orifice_flow


def leak_1_ambient(p1: float, p_amb: float, k: float, growth: float, opening: float) -> float:
    """Return the mass flow of a leak out of chamber 1 whose orifice widens with the pressure.

    Args:
        p1: Pressure of chamber 1 in Pa.
        p_amb: Ambient pressure in Pa.
        k: Flow constant of the gas in s/m.
        growth: Growth of the effective area over pressure in m^2/Pa.
        opening: Pressure above ambient in Pa at which the leak opens.

    Returns:
        Mass flow in kg/s; 0 below the opening pressure.

    >>> leak_1_ambient(3e5, 1e5, 4.876e-3, 1e-14, 2.5e5)
    0.0
    >>> round(1e6 * leak_1_ambient(6e5, 1e5, 4.876e-3, 1e-14, 2.5e5), 3)
    3.54
    """
    return growth * max(p1 - p_amb - opening, 0.0) * orifice_flow(p1, p_amb, 0.528, k, k)


EFFECT = Effect(
    name="opening-leak",
    title="Leak of chamber 1 that opens under pressure",
    part="chamber",
    parameters=(
        Parameter(
            "growth",
            "m^2/Pa",
            0.0,
            0.0,
            "5 valve areas per supply pressure",
            ("0.02 valve areas per supply pressure", "0.1 valve areas per supply pressure"),
            "leak area for each pascal above the opening pressure",
        ),
        Parameter(
            "opening",
            "Pa",
            None,
            0.0,
            "1 supply pressures",
            ("0.3 supply pressures", "0.6 supply pressures"),
            "pressure above ambient at which it opens",
        ),
    ),
    ports={"leak_1_ambient": leak_1_ambient},
    equation=(
        "$q = c\\,\\max(0,\\, p_1 - p_{amb} - p_o)\\; p_1 \\sqrt{2/(R T)}\\, \\Psi'(p_{amb}/p_1)$, leaving chamber 1."
    ),
    looks_like="The pressure falls while it is high, and below a certain pressure it stays.",
    shows_over="p1",
    twins=("laminar-leak", "chamber-leak"),
    separate="Shut the valve at several pressures and hold each for 30 s or longer.",
    source="a seal's lip or a relief valve against its spring: opening in proportion to the excess pressure",
)
