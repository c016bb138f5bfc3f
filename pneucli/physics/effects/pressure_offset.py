"""Offset of the sensor of p1."""

from pneucli.physics.declaration import Effect, Parameter


def read(p: float, p_amb: float, offset: float) -> float:
    """Reading in Pa."""
    return p + offset


def unread(p: float, p_amb: float, offset: float) -> float:
    """True pressure in Pa from a reading."""
    return p - offset


EFFECT = Effect(
    name="pressure-offset",
    title="Offset of the sensor of p1",
    part="sensor",
    parameters=(
        Parameter(
            "offset",
            "Pa",
            0.0,
            "-0.3 supply pressures",
            "0.3 supply pressures",
            ("0.01 supply pressures", "-0.01 supply pressures"),
            "offset of the reading",
        ),
    ),
    ports={"read_p1": read, "unread_p1": unread},
    equation="$p_{1,read} = p_1 + p_0$",
    looks_like=(
        "A vented chamber does not read ambient pressure; with measured pressures as inputs the force is "
        "off by area times offset."
    ),
    shows_over="p1",
    twins=("constant-force", "friction-asymmetry"),
    separate="Vent both chambers and read both sensors.",
    source="zero error of a pressure sensor",
)
