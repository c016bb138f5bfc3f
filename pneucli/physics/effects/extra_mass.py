"""Payload that the rig's description misses."""

from pneucli.physics.declaration import Effect, Parameter


def mass(mass: float) -> float:
    """Return the mass that moves in addition to the rig's.

    Args:
        mass: Payload in kg.

    Returns:
        The mass in kg.

    >>> mass(0.5)
    0.5
    """
    return mass


EFFECT = Effect(
    name="extra-mass",
    title="Payload that the rig's description misses",
    part="cylinder",
    parameters=(
        Parameter("mass", "kg", 0.0, 0.0, "500 moving masses", ("0.25 moving masses", "1 moving masses"), "mass"),
    ),
    ports={"mass": mass},
    equation="$(m + m_+)\\dot v = \\dots$",
    looks_like="The error of the force is proportional to acceleration.",
    shows_over="a",
    twins=("friction-hysteresis", "pressure-scale"),
    separate="The same motion at twice the acceleration; or weigh it.",
    source="Newton",
)
