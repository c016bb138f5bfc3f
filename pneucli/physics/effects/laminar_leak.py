"""Leak of chamber 1 through a long narrow gap."""

from pneucli.physics.declaration import Effect, Parameter


def leak_1_ambient(p1: float, p_amb: float, k: float, conductance: float) -> float:
    """Mass flow out of chamber 1 in kg/s: laminar flow of a gas, by the difference of the squares of the pressures."""
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
            "1 valve conductances",
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
