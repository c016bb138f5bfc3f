"""Break-away force that grows with the time at rest."""

import math

from pneucli.physics.declaration import Effect, Parameter


def static_factor(rest_time: float, gain: float, time_constant: float) -> float:
    """Return the factor on the friction that holds after a standstill.

    Args:
        rest_time: Duration of the standstill in s.
        gain: Growth of the holding friction after a long standstill.
        time_constant: Time constant of the growth in s.

    Returns:
        Factor, 1 at ``rest_time`` = 0.

    >>> round(static_factor(5.0, 0.4, 5.0), 4)
    1.2528
    """
    return 1.0 + gain * (1.0 - math.exp(-rest_time / time_constant))


EFFECT = Effect(
    name="dwell-breakaway",
    title="Break-away force that grows with the time at rest",
    part="cylinder",
    parameters=(
        Parameter(
            "gain",
            "1",
            0.0,
            0.0,
            10.0,
            (0.3, 1.0),
            "growth of static friction after a long rest",
            multiplies="friction.coulomb",
        ),
        Parameter(
            "time_constant",
            "s",
            None,
            "0.002 response times",
            "2e4 response times",
            ("0.2 response times", "1 response times", "4 response times"),
            "time constant of the growth",
        ),
    ),
    ports={"static_factor": static_factor},
    equation="$F_s(1 + k(1 - e^{-t_{rest}/\\tau}))$",
    looks_like="The longer the piston has rested, the later it breaks away and the further it jumps.",
    shows_over="time",
    twins=("stribeck",),
    separate="Break away after rests of 0.1, 1, 10 and 100 s.",
    source="Rabinowicz, J. Appl. Phys. 22 (1951)",
)
