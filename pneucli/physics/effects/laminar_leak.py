"""Leak of chamber 1 through a long narrow gap."""

from pneucli.physics.declaration import Effect, Parameter


def leak_1_ambient(p1: float, p_amb: float, k: float, conductance: float) -> float:
    """Return the mass flow of a leak out of chamber 1: laminar, by the difference of the squared pressures.

    Args:
        p1: Pressure of chamber 1 in Pa.
        p_amb: Ambient pressure in Pa.
        k: Flow constant of the gas in s/m.
        conductance: Mass flow over the pressure difference near ambient, in kg/(s Pa).

    Returns:
        Mass flow in kg/s.

    >>> leak_1_ambient(3e5, 1e5, 4.876e-3, 1e-10)
    4e-05
    """
    return conductance * (p1 * p1 - p_amb * p_amb) / (2.0 * p_amb)


EFFECT = Effect(
    name="laminar-leak",
    title="Leak of chamber 1 through a long narrow gap",
    part="chamber",
    parameters=(
        Parameter(
            "conductance",
            "kg/(s Pa)",
            0.0,
            0.0,
            "5 valve conductances",
            ("0.002 valve conductances", "0.01 valve conductances"),
            "flow per pressure difference near ambient",
        ),
    ),
    ports={"leak_1_ambient": leak_1_ambient},
    equation="$q = G\\,(p_1^2 - p_{amb}^2) / (2\\,p_{amb})$, leaving chamber 1.",
    looks_like=(
        "As a leak through a hole, but at high pressure more and at low pressure less: from 8 to 2 bar the flow falls "
        "21-fold, through a hole 4-fold."
    ),
    shows_over="p1",
    twins=("chamber-leak", "opening-leak", "valve-leak"),
    separate="Shut the valve at high pressure and record the decay down to a third of it or further.",
    source="Hagen-Poiseuille flow of an ideal gas at constant temperature: along a scratch, a thread, a porous seal",
)
