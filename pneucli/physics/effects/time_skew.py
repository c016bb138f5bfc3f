"""Pressures recorded later than the other channels."""

from pneucli.physics.declaration import Effect, Parameter


def sensor_delay(delay: float) -> float:
    """Return the time by which the readings of p1 and p2 are recorded late.

    Args:
        delay: Delay in s.

    Returns:
        The delay in s.

    >>> sensor_delay(1e-3)
    0.001
    """
    return delay


EFFECT = Effect(
    name="time-skew",
    title="Pressures recorded later than the other channels",
    part="sensor",
    parameters=(
        Parameter(
            "delay",
            "s",
            0.0,
            0.0,
            "0.5 horizons",
            ("0.005 response times", "0.02 response times"),
            "delay of p1 and p2",
            "0.5 sampling periods",
        ),
    ),
    ports={"sensor_delay": sensor_delay},
    equation="$p_{read}(t) = p(t - \\tau)$",
    looks_like=("All pressures come late by the same time, against command and motion, however fast the change."),
    shows_over="p1",
    twins=("line-delay", "pressure-lag", "valve-lag"),
    separate="Tap the cylinder while venting: one event seen by all sensors.",
    source="multiplexed or filtered channels of a logger",
)
