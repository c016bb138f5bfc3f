"""Leak of chamber 1 through a long narrow gap."""

import math

from pneucli.physics.declaration import Effect, Parameter


def leak_1_ambient(p1: float, p_amb: float, k: float, conductance: float, turbulence: float) -> float:
    """Return the mass flow of a leak out of chamber 1, by the difference of the squared pressures.

    The difference is the sum of what friction takes, a q, and what turbulence and the change of the velocity take,
    b q^2. Without the second the flow is laminar, without the first that of a hole.

    Args:
        p1: Pressure of chamber 1 in Pa.
        p_amb: Ambient pressure in Pa.
        k: Flow constant of the gas in s/m.
        conductance: Mass flow over the pressure difference near ambient, 2 p_amb / a, in kg/(s Pa).
        turbulence: b p_amb^2 / a^2.

    Returns:
        Mass flow in kg/s.

    References:
        P. Forchheimer, Zeitschrift des VDI 45 (1901) 1782 (loss linear and quadratic in the flow), for an ideal gas at
        constant temperature.

    >>> leak_1_ambient(3e5, 1e5, 4.876e-3, 1e-10, 0.0)
    4e-05
    >>> leak_1_ambient(3e5, 1e5, 4.876e-3, 1e-10, 0.25)
    2e-05
    """
    difference = p1 * p1 - p_amb * p_amb
    laminar = conductance * difference / (2.0 * p_amb)
    return 2.0 * laminar / (1.0 + math.sqrt(1.0 + 4.0 * turbulence * abs(difference) / (p_amb * p_amb)))


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
        Parameter(
            "turbulence",
            "1",
            None,
            0.0,
            100.0,  # 7 bar above ambient all but 1 % of the loss is quadratic, as in a hole
            (0.05, 0.5),
            "loss by turbulence, quadratic in the flow",
            refines=True,
            unrefined=0.0,
        ),
    ),
    ports={"leak_1_ambient": leak_1_ambient},
    equation=(
        "$p_1^2 - p_{amb}^2 = a\\,q + b\\,q^2$, $a = 2\\,p_{amb}/G$, $b = \\tau\\,a^2/p_{amb}^2$; "
        "$q$ leaving chamber 1."
    ),
    looks_like=(
        "As a leak through a hole, but at high pressure more and at low pressure less: from 8 to 2 bar the flow falls "
        "21-fold, through a hole 4-fold; with turbulence it is between both."
    ),
    shows_over="p1",
    twins=("chamber-leak", "opening-leak", "valve-leak"),
    separate="Shut the valve at high pressure and record the decay down to a third of it or further.",
    source=(
        "Hagen-Poiseuille flow of an ideal gas at constant temperature: along a scratch, a thread, a porous seal; "
        "with turbulence: P. Forchheimer, Z. VDI 45 (1901) 1782"
    ),
)
