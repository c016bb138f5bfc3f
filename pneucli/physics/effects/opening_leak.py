"""Leak of chamber 1 that opens under pressure."""

from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.gas import orifice_flow


def leak_1_ambient(p1: float, p_amb: float, k: float, growth: float, opening: float) -> float:
    """Mass flow out of chamber 1 in kg/s, an orifice with critical ratio 0.528 that widens with the pressure."""
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
