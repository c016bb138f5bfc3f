"""Seals that press harder under pressure."""

from pneucli.physics.declaration import Effect, Parameter


def dry_factor(direction: float, x: float, p1: float, p2: float, p_amb: float, gain: float) -> float:
    """Factor on dry friction for the pressures above ambient in both chambers."""
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
        ),
    ),
    ports={"dry_factor": dry_factor},
    equation="$F_{dry} \\left(1 + k\\,[(p_1 - p_{amb}) + (p_2 - p_{amb})]\\right)$",
    looks_like="The error has the sign of the velocity and grows with pressure.",
    shows_over="p1",
    twins=("position-friction", "pressure-scale"),
    separate="One speed at three pressure levels.",
    source="Belforte et al., seal friction; van Varseveld and Bone, IEEE/ASME Trans. Mechatronics 2 (1997)",
)
