"""Stribeck friction."""

from pneucli.physics.declaration import Effect, Parameter


def dry_rise(coulomb: float, v: float, static: float, velocity: float) -> float:
    """Return dry friction above Coulomb friction, in the form of Hess and Soom.

    Args:
        coulomb: Coulomb friction in N.
        v: Velocity in m/s.
        static: Static friction in N.
        velocity: Stribeck velocity in m/s.

    Returns:
        Friction in N to be added to Coulomb friction.

    References:
        Thesis 3.6; D. P. Hess and A. Soom, ASME J. Tribology 112 (1990) 147-152.

    >>> dry_rise(3.0, 0.0, 5.0, 0.02), dry_rise(3.0, 0.02, 5.0, 0.02)
    (2.0, 1.0)
    """
    r = v / velocity
    return (static - coulomb) / (1.0 + r * r)


EFFECT = Effect(
    name="stribeck",
    title="Stribeck friction",
    part="cylinder",
    parameters=(
        Parameter(
            "static",
            "N",
            "friction.coulomb",
            0.0,
            "2 supply forces",  # a piston that moves was driven by more than it
            ("1.3 Coulomb forces", "1.8 Coulomb forces"),
            "static friction",
            direct="static",
        ),
        Parameter(
            "velocity",
            "m/s",
            None,
            "0.001 top speeds",
            "1 top speeds",
            ("0.0125 top speeds", "0.04 top speeds", "0.1 top speeds"),
            "Stribeck velocity",
            direct="velocity",
        ),
    ),
    ports={"dry_rise": dry_rise},
    equation="$F = \\left[F_c + \\frac{F_s - F_c}{1 + (v/v_s)^2}\\right]\\mathrm{sign}\\,v + F_v v$",
    looks_like=("The piston breaks away later and jumps further than the model; the error stands near standstill."),
    shows_over="v",
    twins=("dwell-breakaway", "presliding", "friction-hysteresis"),
    separate="Constant slow velocities over a decade on each side of the expected Stribeck velocity.",
    source="thesis 3.6; Hess and Soom, ASME J. Tribology 112 (1990)",
)
