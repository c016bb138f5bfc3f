"""Bias of the accelerometer."""

from pneucli.physics.declaration import Effect, Parameter


def read_a(a: float, bias: float) -> float:
    """Return the reading of an accelerometer with a bias.

    Args:
        a: Acceleration in m/s^2.
        bias: Reading at rest in m/s^2.

    Returns:
        The reading in m/s^2.

    >>> read_a(2.0, 0.5)
    2.5
    """
    return a + bias


EFFECT = Effect(
    name="acceleration-bias",
    title="Bias of the accelerometer",
    part="sensor",
    parameters=(
        Parameter(
            "bias",
            "m/s^2",
            0.0,
            "-0.3 supply forces per mass",
            "0.3 supply forces per mass",
            ("0.0015 supply forces per mass", "-0.0015 supply forces per mass"),
            "bias",
        ),
    ),
    ports={"read_a": read_a},
    equation="$a_{read} = a + b$",
    looks_like="The accelerometer does not read zero at rest; the error of a is a constant.",
    shows_over="time",
    twins=(),
    separate="Rest for a second before each recording; turn the sensor over.",
    source="zero error or tilt of an accelerometer",
)
