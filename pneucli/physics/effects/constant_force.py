"""A constant force on the piston."""

from pneucli.physics.declaration import Effect, Parameter


def force(x: float, v: float, stroke: float, force: float) -> float:
    """Return a constant force on the piston: weight on a slope, a hanging load.

    Args:
        x: Position in m.
        v: Velocity in m/s.
        stroke: Stroke in m.
        force: Size of the force in N, positive toward -x.

    Returns:
        Force toward +x in N.

    >>> force(0.1, 0.0, 0.2, 20.0)
    -20.0
    """
    return -force


EFFECT = Effect(
    name="constant-force",
    title="A constant force on the piston",
    part="cylinder",
    parameters=(
        Parameter(
            "force",
            "N",
            0.0,
            "-10 supply forces",
            "10 supply forces",
            ("0.02 supply forces", "-0.02 supply forces"),
            "force toward x = 0",
            stated="weight",
        ),
    ),
    ports={"force": force},
    equation="$m \\dot v = \\dots - F$",
    looks_like="The error of the force is the same in both directions, at rest and at all pressures.",
    shows_over="direction",
    twins=("friction-asymmetry", "pressure-offset"),
    separate="Vent both chambers and see which way the piston creeps, or turn the rig over.",
    source="Newton",
)
