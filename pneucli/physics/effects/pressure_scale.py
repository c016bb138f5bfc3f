"""Scale of the pressure sensors, or of the piston's area."""

from pneucli.physics.declaration import Effect, Parameter


def read(p: float, p_amb: float, scale: float) -> float:
    """Return the reading of a pressure sensor with a wrong scale.

    Args:
        p: Pressure in Pa.
        p_amb: Ambient pressure in Pa, where the sensor reads right.
        scale: Scale of the sensor; 1 is right.

    Returns:
        The reading in Pa.

    >>> read(3e5, 1e5, 1.25)
    350000.0
    """
    return p_amb + scale * (p - p_amb)


def unread(p: float, p_amb: float, scale: float) -> float:
    """Return the pressure from a reading; the inverse of :func:`read`.

    Args:
        p: Reading in Pa.
        p_amb: Ambient pressure in Pa.
        scale: Scale of the sensor.

    Returns:
        The pressure in Pa.

    >>> unread(350_000.0, 1e5, 1.25)
    300000.0
    """
    return p_amb + (p - p_amb) / scale


EFFECT = Effect(
    name="pressure-scale",
    title="Scale of the pressure sensors, or of the piston's area",
    part="sensor",
    parameters=(Parameter("scale", "1", 1.0, 0.5, 2.0, (1.03, 0.97), "reading over true, above ambient"),),
    ports={"read_p1": read, "read_p2": read, "unread_p1": unread, "unread_p2": unread},
    equation="$p_{read} - p_{amb} = k\\,(p - p_{amb})$",
    looks_like=(
        "The error of the force is proportional to the pressure force; full chambers do not read the supply pressure."
    ),
    shows_over="p1",
    twins=("extra-mass", "pressure-friction"),
    separate="Compare the sensors with a reference gauge at supply pressure; measure the bore.",
    source="span error of a pressure sensor",
)
