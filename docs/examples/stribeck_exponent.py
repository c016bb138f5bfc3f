"""Stribeck friction with an exponent, thesis (3.5): (Fs - Fc) exp(-|v / vs|^delta) above Coulomb friction."""

import math

from pneucli.physics.declaration import Effect, Parameter


def dry_rise(coulomb: float, v: float, static: float, velocity: float, exponent: float) -> float:
    """Return the dry friction above Coulomb's in N at the speed |v| (m/s)."""
    return (static - coulomb) * math.exp(-math.pow(math.fabs(v) / velocity, exponent))


EFFECT = Effect(
    name="stribeck-exponent",
    title="Stribeck friction with an exponent",
    part="cylinder",
    parameters=(
        Parameter(
            "static", "N", "friction.coulomb", 0.0, "2 supply forces", ("1.3 Coulomb forces",), "static friction"
        ),
        Parameter(
            "velocity", "m/s", None, "0.001 top speeds", "1 top speeds", ("0.04 top speeds",), "Stribeck velocity"
        ),
        Parameter("exponent", "1", None, 0.25, 4.0, (2.0,), "exponent delta; 1 by Tustin, 2 by Armstrong-Helouvry"),
    ),
    ports={"dry_rise": dry_rise},
    equation="$F = [F_c + (F_s - F_c) \\exp(-|v / v_s|^\\delta)]\\,\\mathrm{sign}\\,v + F_v v$",
    looks_like="The piston breaks away later and jumps further than the model; the error stands near standstill.",
    shows_over="v",
    twins=("stribeck",),
    separate="Constant slow velocities over a decade on each side of the expected Stribeck velocity.",
    source="thesis 3.5; Bo and Pavelescu, Wear 82 (1982); Armstrong-Helouvry et al., Automatica 30 (1994)",
)
