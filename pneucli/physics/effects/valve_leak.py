"""Leak of the valve at every command."""

from pneucli.physics.declaration import Effect, Parameter


def leak_area(area: float) -> float:
    """Return the area that stays open at every command: from supply to outlet, and from outlet to exhaust.

    Args:
        area: Effective area in m^2.

    Returns:
        The area in m^2.

    >>> leak_area(1e-8)
    1e-08
    """
    return area


EFFECT = Effect(
    name="valve-leak",
    title="Leak of the valve at every command",
    part="valve",
    parameters=(
        Parameter(
            "area", "m^2", 0.0, 0.0, "5 valve areas", ("0.01 valve areas", "0.05 valve areas"), "leak area of each edge"
        ),
    ),
    ports={"leak_area": leak_area},
    equation=(
        "$q = A\\,[\\,p_S\\text{-to-}p_1 \\text{ flow} - p_1\\text{-to-}p_{amb} \\text{ flow}\\,]$ at every command"
    ),
    looks_like="At u = 0 the pressure drifts toward a value between supply and ambient, from both sides.",
    shows_over="p1",
    twins=("chamber-leak",),
    separate=(
        "Hold u = 0 from full and from empty: a valve leak drives both to the same middle pressure, a "
        "chamber leak both to ambient."
    ),
    source="underlap of the control edges",
)
