"""Offset of the sensor of p1."""

from pneucli.physics.declaration import Effect, Parameter


def read(p: float, p_amb: float, offset: float) -> float:
    """Return the reading of a pressure sensor with an offset.

    Args:
        p: Pressure in Pa.
        p_amb: Ambient pressure in Pa.
        offset: Offset of the sensor in Pa.

    Returns:
        The reading in Pa.

    >>> read(2e5, 1e5, 500.0)
    200500.0
    """
    return p + offset


def unread(p: float, p_amb: float, offset: float) -> float:
    """Return the pressure from a reading; the inverse of :func:`read`.

    Args:
        p: Reading in Pa.
        p_amb: Ambient pressure in Pa.
        offset: Offset of the sensor in Pa.

    Returns:
        The pressure in Pa.

    >>> unread(200_500.0, 1e5, 500.0)
    200000.0
    """
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
