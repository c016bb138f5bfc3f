"""Seals that press harder under pressure."""

from pneucli.physics.declaration import Effect, Parameter, Untold


def dry_factor(direction: float, x: float, p1: float, p2: float, p_amb: float, gain: float) -> float:
    """Return the factor on dry friction under pressure.

    Args:
        direction: 1 toward +x, -1 toward -x.
        x: Position in m.
        p1: Pressure of chamber 1 in Pa.
        p2: Pressure of chamber 2 in Pa.
        p_amb: Ambient pressure in Pa.
        gain: Relative growth of dry friction in 1/bar, over the sum of both pressures above ambient.

    Returns:
        Factor on dry friction.

    >>> round(dry_factor(1.0, 0.1, 3e5, 2e5, 1e5, 0.1), 6)
    1.3
    """
    return 1.0 + gain * ((p1 - p_amb) + (p2 - p_amb)) * 1e-5


EFFECT = Effect(
    name="pressure-friction",
    title="Seals that press harder under pressure",
    part="cylinder",
    parameters=(
        Parameter(
            "gain",
            "1/bar",
            0.0,
            "-0.5 per supply pressure",
            "20 per supply pressure",
            ("0.3 per supply pressure", "1.2 per supply pressure"),
            "growth of dry friction per bar",
            multiplies="friction.coulomb",
        ),
    ),
    ports={"dry_factor": dry_factor},
    equation="$F_{dry} \\left(1 + k\\,[(p_1 - p_{amb}) + (p_2 - p_{amb})]\\right)$",
    looks_like="The error has the sign of the velocity and grows with pressure.",
    shows_over="p1",
    twins=("position-friction", "pressure-scale"),
    separate="One speed at three pressure levels.",
    source="Belforte et al., seal friction; van Varseveld and Bone, IEEE/ASME Trans. Mechatronics 2 (1997)",
    untold=Untold(lambda rng, rig: {"gain": rng.uniform(0.0, 0.05)}),
)
