"""Less friction while slowing than while speeding up."""

from pneucli.physics.declaration import Effect, Parameter


def slowing(drop: float, viscous_drop: float) -> float:
    """Return dry friction while slowing, relative to Coulomb friction.

    Args:
        drop: Relative drop of dry friction while slowing.
        viscous_drop: Relative drop of viscous friction while slowing.

    Returns:
        Factor on Coulomb friction.

    References:
        Thesis (3.7), (6.21).

    >>> slowing(0.25, 0.0)
    0.75
    """
    return 1.0 - drop


def slowing_viscous(drop: float, viscous_drop: float) -> float:
    """Return viscous friction while slowing, relative to that while speeding up.

    Args:
        drop: Relative drop of dry friction while slowing.
        viscous_drop: Relative drop of viscous friction while slowing.

    Returns:
        Factor on viscous friction.

    References:
        Thesis (3.7): constants of its own while slowing.

    >>> slowing_viscous(0.0, 0.5)
    0.5
    """
    return 1.0 - viscous_drop


EFFECT = Effect(
    name="friction-hysteresis",
    title="Less dry friction while slowing than while speeding up",
    part="cylinder",
    parameters=(
        Parameter(
            "drop",
            "1",
            0.0,
            0.0,
            0.95,
            (0.15, 0.4),
            "share of Coulomb friction lost while slowing",
            multiplies="friction.coulomb",
            direct="drop",
        ),
        Parameter(
            "viscous_drop",
            "1",
            0.0,
            -3.0,
            0.95,
            (0.2, -0.2),
            "share of viscous friction lost while slowing",
            multiplies="friction.viscous",
            refines=True,
        ),
    ),
    ports={"slowing": slowing, "slowing_viscous": slowing_viscous},
    equation=(
        "$F = F_c(1 - d)\\,\\mathrm{sign}\\,v + F_v(1 - d_v)\\,v$ while slowing, without the Stribeck rise; "
        "between both branches $\\dot v = 0$ (Filippov)"
    ),
    looks_like="Friction over velocity makes a loop: the model brakes too hard while slowing.",
    shows_over="a",
    twins=("stribeck", "extra-mass"),
    separate=("Triangular velocity at two accelerations: a mass error grows with acceleration, hysteresis does not."),
    source="thesis 3.7, 6.21 (Nouri)",
)
