"""Lag of the spool, of first or of second order."""

import math

from pneucli.physics.declaration import Effect, Parameter, Untold


def lagged(u: float, s: float, h: float, time: float) -> tuple[float, float]:
    """Return the mean over a step behind a first-order lag, exact for a held command, and the state after it.

    Args:
        u: Command in V.
        s: State in V at the start of the step.
        h: Step in s.
        time: Time constant in s.

    Returns:
        Mean in V, and the state in V after the step.

    >>> mean, after = lagged(1.0, 0.0, 5e-3, 5e-3)
    >>> round(mean, 4), round(after, 4)
    (0.3679, 0.6321)
    """
    if time <= 0.0:
        return u, u
    closed = 1.0 - math.exp(-h / time)  # expm1 costs more and would add nothing
    return u + (s - u) * closed * time / h, s + (u - s) * closed


def drive(u: float, s: float, opening: float, h: float, time_constant: float, roundness: float) -> tuple[float, float]:
    """Return the mean command over a step that the opening follows, and its value after the step.

    Args:
        u: Command in V.
        s: State, the command that the opening follows, in V at the start of the step.
        opening: Position of the spool in V at the start of the step.
        h: Step in s.
        time_constant: Time constant in s.
        roundness: 0: a first-order spool; 1 over the square of the damping ratio.

    Returns:
        Mean command in V, and the state in V after the step.

    >>> drive(1.0, 0.0, 0.0, 1e-3, 5e-3, 0.0)
    (1.0, 1.0)
    """
    if time_constant <= 0.0:
        return u, u
    return lagged(u + 0.25 * roundness * (s - opening), s, h, 0.25 * roundness * time_constant)


def command(u: float, s: float, h: float, time_constant: float, roundness: float) -> tuple[float, float]:
    """Return the mean opening over a step behind a lag, exact for a held command.

    Args:
        u: Command in V.
        s: State, the position of the spool in V at the start of the step.
        h: Step in s.
        time_constant: Time constant in s.
        roundness: See :func:`drive`.

    Returns:
        Mean opening in V, and the position of the spool after the step.

    >>> mean, after = command(1.0, 0.0, 5e-3, 5e-3, 0.0)
    >>> round(mean, 4), round(after, 4)
    (0.3679, 0.6321)
    """
    return lagged(u, s, h, time_constant)


EFFECT = Effect(
    name="valve-lag",
    title="Lag of the spool",
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
        Parameter(
            "roundness",
            "1",
            None,
            0.0,
            4.0,  # a damping ratio of 0.5
            (1.0, 2.0),
            "of the begin of a step: 1 over the square of the damping ratio",
            refines=True,
            unrefined=0.0,
        ),
    ),
    ports={"drive": drive, "command": command},
    equation=("$\\frac{r \\tau^2}{4} \\ddot s + \\tau \\dot s + s = u$, the opening follows $s$; $r = 0$: first order"),
    looks_like=(
        "The error stands after each change of the command and dies out with the time constant; the "
        "pressure starts softly."
    ),
    shows_over="u",
    twins=("line-delay", "pressure-lag", "time-skew"),
    separate=("Step the command and record at 10 kHz; large and small steps (a lag scales, a delay does not)."),
    source="spools of first and second order: Jelali and Kroll, Hydraulic Servo-Systems (2003), ch. 4",
    order=1,
    untold=Untold(lambda rng, rig: {"time_constant": rng.uniform(0.0, 10e-3)}),
)
