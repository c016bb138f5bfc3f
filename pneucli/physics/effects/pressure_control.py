"""A valve with a pressure loop of its own: an I/P converter, a proportional pressure regulator."""

from pneucli.physics.declaration import Effect, Parameter


def demand(u: float, p: float, p_amb: float, span: float, band: float) -> float:
    """Return the opening of a valve that compares its outlet pressure with its command.

    Near the pressure that it is asked for, a chamber behind it follows as a first-order lag; further away it fills and
    vents through the full opening.

    Args:
        u: Command in V from the one that asks for ambient pressure.
        p: Pressure at the outlet in Pa.
        p_amb: Ambient pressure in Pa.
        span: Pressure above ambient that a volt asks for in Pa/V.
        band: Error in V at which the valve is fully open.

    Returns:
        Opening in V, positive where it fills.

    >>> [demand(u, 3e5, 1e5, 5e4, 0.5) for u in (4.0, 4.25, 9.0, 0.0)]
    [0.0, 0.25, 0.5, -0.5]
    """
    return min(max(u - (p - p_amb) / span, -band), band)


EFFECT = Effect(
    name="pressure-control",
    title="Pressure control in the valve",
    part="pressure valve",
    parameters=(
        Parameter(
            "span",
            "Pa/V",
            None,
            "0.05 supply pressures per full command",
            "5 supply pressures per full command",
            ("0.5 supply pressures per full command", "0.9 supply pressures per full command"),
            "pressure above ambient for each volt",
        ),
        Parameter(
            "band",
            "V",
            None,
            "0.005 full commands",
            "1 full commands",
            ("0.05 full commands", "0.1 full commands", "0.2 full commands"),
            "error at which it is fully open",
        ),
    ),
    ports={"demand": demand},
    equation="opening $= \\min(\\max(u - (p - p_{amb})/s,\\, -b),\\, b)$",
    looks_like="At each command the pressure settles at a level of its own in place of rising to the supply.",
    shows_over="u",
    twins=(),
    separate="Hold several commands until the pressure rests: a valve without a loop rests at supply or ambient.",
    source="proportional pressure regulators and I/P converters (data sheets)",
    nested=False,
)
