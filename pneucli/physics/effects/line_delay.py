"""Delay in the hoses between valve and chambers."""

from pneucli.physics.declaration import Effect, Parameter


def flow_delay(delay: float) -> float:
    """Return the time by which the flow of the valve arrives later in a chamber.

    Args:
        delay: Delay in s.

    Returns:
        The delay in s.

    >>> flow_delay(3e-3)
    0.003
    """
    return delay


EFFECT = Effect(
    name="line-delay",
    title="Delay in the hose between valve and chamber",
    part="line",
    parameters=(
        Parameter(
            "delay",
            "s",
            0.0,
            0.0,
            "0.3 response times",
            ("0.01 response times", "0.03 response times"),
            "delay",
        ),
    ),
    ports={"flow_delay": flow_delay},
    equation="$q_i(t) = q_{valve,i}(t - \\tau)$",
    looks_like=(
        "The error stands where the command changes fast, proportional to the change of flow: the "
        "measured pressure follows later, then at the right slope."
    ),
    shows_over="u",
    twins=("valve-lag", "time-skew", "pressure-lag"),
    separate=(
        "Step the command and record the pressure at 10 kHz: a dead time starts late and sharp, a lag "
        "starts at once and soft."
    ),
    source="speed of sound in the hose, length / 343 m/s and more",
)
