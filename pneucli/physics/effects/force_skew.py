"""A force recorded later or earlier than the motion."""

from pneucli.physics.declaration import Effect, Parameter


def force_delay(delay: float) -> float:
    """Return the time by which the reading of the force is recorded late.

    Args:
        delay: Delay in s; negative where the other channels are late.

    Returns:
        The delay in s.

    >>> force_delay(-2e-3)
    -0.002
    """
    return delay


EFFECT = Effect(
    name="force-skew",
    title="Force recorded later or earlier than the motion",
    part="sensor",
    parameters=(
        Parameter(
            "delay",
            "s",
            0.0,
            "-0.5 horizons",
            "0.5 horizons",
            ("0.005 response times", "-0.005 response times", "0.02 response times", "-0.02 response times"),
            "delay of the force behind the motion",
            "0.5 sampling periods",
        ),
    ),
    ports={"force_delay": force_delay},
    equation="$F_{read}(t) = F(t - \\tau)$",
    looks_like="At every reversal the force turns late or early, by the same time whatever the speed.",
    shows_over="time",
    twins=("presliding", "extra-mass"),
    separate="Push the piston against its stop by hand: one event seen by force and position.",
    source="an amplifier that filters, two loggers, or motion differentiated with a delay",
    needs=frozenset({"force"}),
)
