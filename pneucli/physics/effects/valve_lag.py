"""First-order lag of the spool."""

import math

from pneucli.physics.declaration import Effect, Parameter, Untold


def command(u: float, s: float, h: float, time_constant: float) -> tuple[float, float]:
    """Return the mean opening over a step behind a first-order lag, exact for a held command.

    Args:
        u: Command in V.
        s: State, the position of the spool in V at the start of the step.
        h: Step in s.
        time_constant: Time constant in s.

    Returns:
        Mean opening in V, and the position of the spool after the step.

    >>> mean, after = command(1.0, 0.0, 5e-3, 5e-3)
    >>> round(mean, 4), round(after, 4)
    (0.3679, 0.6321)
    """
    if time_constant <= 0.0:
        return u, u
    closed = 1.0 - math.exp(-h / time_constant)  # expm1 costs more and would add nothing
    return u + (s - u) * closed * time_constant / h, s + (u - s) * closed


EFFECT = Effect(
    name="valve-lag",
    title="First-order lag of the spool",
    part="valve",
    parameters=(
        Parameter(
            "time_constant",
            "s",
            0.0,
            0.0,
            "1 horizons",
            ("0.015 response times", "0.05 response times"),
            "time constant of the spool",
            direct="lag",
        ),
    ),
    ports={"command": command},
    equation="$\\tau \\dot s = u - s$, the opening follows $s$",
    looks_like=(
        "The error stands after each change of the command and dies out with the time constant; the "
        "pressure starts softly."
    ),
    shows_over="u",
    twins=("line-delay", "pressure-lag", "time-skew"),
    separate=("Step the command and record at 10 kHz; large and small steps (a lag scales, a delay does not)."),
    source="first-order spool dynamics of proportional valves",
    order=1,
    untold=Untold(lambda rng, rig: {"time_constant": rng.uniform(0.0, 10e-3)}),
)
