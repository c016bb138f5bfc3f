"""A constant force on the piston."""

from pneucli.physics.declaration import Effect, Parameter


def force(x: float, v: float, stroke: float, force: float) -> float:
    """Force toward +x in N: weight on a slope, a hanging load."""
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
