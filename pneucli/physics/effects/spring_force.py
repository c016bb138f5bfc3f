"""A spring between piston and frame."""

from pneucli.physics.declaration import Effect, Parameter


def force(x: float, v: float, stroke: float, stiffness: float, rest_position: float) -> float:
    """Return the force of a spring between piston and frame.

    Args:
        x: Position in m.
        v: Velocity in m/s.
        stroke: Stroke in m.
        stiffness: Stiffness in N/m.
        rest_position: Position in m at which the spring is relaxed.

    Returns:
        Force toward +x in N.

    >>> force(0.15, 0.0, 0.2, 200.0, 0.05)
    -20.0
    """
    return -stiffness * (x - rest_position)


EFFECT = Effect(
    name="spring-force",
    title="A spring between piston and frame",
    part="cylinder",
    parameters=(
        Parameter(
            "stiffness",
            "N/m",
            0.0,
            0.0,
            "40 supply forces per stroke",
            ("0.12 supply forces per stroke",),
            "stiffness",
            stated="spring",
        ),
        Parameter(
            "rest_position",
            "m",
            None,
            "-50 ranges of x",
            "50 ranges of x",
            ("0 ranges of x", "0.5 ranges of x", "1 ranges of x"),
            "position without force",
            stated="relaxed position of the spring",
        ),
    ),
    ports={"force": force},
    equation="$F = -k (x - x_0)$",
    looks_like="The error of the force is a straight line over position, the same in both directions.",
    shows_over="x",
    twins=("constant-force", "dead-volume"),
    separate="Vent both chambers, push the piston by hand to five positions and read the force.",
    source="Hooke",
    needs=frozenset({"x"}),
)
