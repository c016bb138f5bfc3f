"""Payload that the rig's description misses."""

from pneucli.physics.declaration import Effect, Parameter
from pneucli.units import STANDARD_GRAVITY


def mass(mass: float, gravity: float) -> float:
    """Return the mass that moves in addition to the rig's.

    Args:
        mass: Payload in kg.
        gravity: Acceleration of free fall along the axis in m/s^2, positive toward -x.

    Returns:
        The mass in kg.

    >>> mass(0.5, 0.0)
    0.5
    """
    return mass


def weight(x: float, v: float, stroke: float, mass: float, gravity: float) -> float:
    """Return the payload's weight along the axis.

    Args:
        x: Position in m.
        v: Velocity in m/s.
        stroke: Stroke in m.
        mass: Payload in kg.
        gravity: Acceleration of free fall along the axis in m/s^2, positive toward -x.

    Returns:
        Force toward +x in N.

    >>> weight(0.1, 0.0, 0.2, 2.0, -9.8)
    19.6
    """
    return -mass * gravity


EFFECT = Effect(
    name="extra-mass",
    title="Payload that the rig's description misses",
    part="cylinder",
    parameters=(
        Parameter("mass", "kg", 0.0, 0.0, "500 moving masses", ("0.25 moving masses", "1 moving masses"), "mass"),
        Parameter(
            "gravity",
            "m/s^2",
            None,
            -STANDARD_GRAVITY,
            STANDARD_GRAVITY,
            (0.0,),
            "free fall along the axis, toward x = 0",
            refines=True,
            unrefined=0.0,
            stated="gravity along the axis",
        ),
    ),
    ports={"mass": mass, "force": weight},
    equation="$(m + m_+)\\dot v = \\dots - m_+ g \\sin\\alpha$",
    looks_like="The error of the force is proportional to acceleration.",
    shows_over="a",
    twins=("friction-hysteresis", "pressure-scale"),
    separate="The same motion at twice the acceleration; or weigh it.",
    source="Newton",
)
