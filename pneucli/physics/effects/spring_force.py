"""A spring between piston and frame."""

from pneucli.physics.declaration import Effect, Parameter


def force(x: float, v: float, stroke: float, stiffness: float, rest_position: float) -> float:
    """Force toward +x in N."""
    return -stiffness * (x - rest_position)


EFFECT = Effect(
    name="spring-force",
    title="A spring between piston and frame",
    part="cylinder",
    parameters=(
        Parameter("stiffness", "N/m", 0.0, 0.0, 1e5, (300.0,), "stiffness"),
        Parameter("rest_position", "m", None, -10.0, 10.0, (0.0, 0.5, 1.0), "position without force", "x"),
    ),
    ports={"force": force},
    equation="$F = -k (x - x_0)$",
    looks_like="The error of the force is a straight line over position, the same in both directions.",
    shows_over="x",
    twins=("constant-force", "dead-volume"),
    separate="Vent both chambers, push the piston by hand to five positions and read the force.",
    source="Hooke",
)
