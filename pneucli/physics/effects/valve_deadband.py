"""Overlap of the valve around its centre."""

from pneucli.physics.declaration import Effect, Parameter


def command(u: float, s: float, h: float, width: float) -> tuple[float, float]:
    """Return the command beyond the dead band.

    Args:
        u: Command in V.
        s: State, not used.
        h: Step in s.
        width: Width of the dead band in V.

    Returns:
        Opening in V, 0 for |u| <= width / 2, and the state.

    >>> command(1.5, 0.0, 1e-3, 1.0), command(-0.25, 0.0, 1e-3, 1.0)
    ((1.0, 0.0), (0.0, 0.0))
    """
    if u > 0.5 * width:
        return u - 0.5 * width, s
    if u < -0.5 * width:
        return u + 0.5 * width, s
    return 0.0, s


EFFECT = Effect(
    name="valve-deadband",
    title="Overlap of the valve around its centre",
    part="linear valve",
    parameters=(
        Parameter(
            "width",
            "V",
            0.0,
            0.0,
            "0.5 full commands",
            ("0.02 full commands", "0.08 full commands"),
            "dead zone, half on each side of the centre",
        ),
    ),
    ports={"command": command},
    equation="$u_{eff} = \\mathrm{sign}(u)\\,\\max(|u| - w/2,\\, 0)$",
    looks_like=(
        "Small commands move nothing although the model does; the error is a constant share of the gain "
        "at large commands."
    ),
    shows_over="u",
    twins=("valve-hysteresis",),
    separate=(
        "A slow ramp of the command through zero, both ways: overlap is symmetric, hysteresis depends on the direction."
    ),
    source="thesis 7.4 (overlap of the spool's borings)",
    order=2,
)
