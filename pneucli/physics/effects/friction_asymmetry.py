"""Friction that differs between the directions."""

from pneucli.physics.declaration import Effect, Parameter


def dry_factor(
    direction: float, x: float, p1: float, p2: float, p_amb: float, asymmetry: float, viscous_asymmetry: float
) -> float:
    """Return the factor on dry friction for the direction of motion, at standstill of the driving force.

    Args:
        direction: 1 toward +x, -1 toward -x.
        x: Position in m.
        p1: Pressure of chamber 1 in Pa.
        p2: Pressure of chamber 2 in Pa.
        p_amb: Ambient pressure in Pa.
        asymmetry: Half the relative difference of dry friction between the directions.
        viscous_asymmetry: The same of viscous friction.

    Returns:
        Factor on dry friction.

    >>> dry_factor(-1.0, 0.1, 2e5, 2e5, 1e5, 0.25, 0.0)
    0.75
    """
    return 1.0 + asymmetry * direction


def viscous_factor(direction: float, asymmetry: float, viscous_asymmetry: float) -> float:
    """Return the factor on viscous friction for the direction of motion.

    Args:
        direction: 1 toward +x, -1 toward -x.
        asymmetry: Half the relative difference of dry friction between the directions.
        viscous_asymmetry: The same of viscous friction.

    Returns:
        Factor on viscous friction.

    >>> viscous_factor(1.0, 0.0, 0.25)
    1.25
    """
    return 1.0 + viscous_asymmetry * direction


EFFECT = Effect(
    name="friction-asymmetry",
    title="Friction that differs between the directions",
    part="cylinder",
    parameters=(
        Parameter("asymmetry", "1", 0.0, -0.95, 0.95, (0.2, -0.2), "of dry friction", multiplies="friction.coulomb"),
        Parameter(
            "viscous_asymmetry",
            "1",
            0.0,
            -0.95,
            0.95,
            (0.2, -0.2),
            "of viscous friction",
            multiplies="friction.viscous",
        ),
    ),
    ports={"dry_factor": dry_factor, "viscous_factor": viscous_factor},
    equation="$F = F_c(1 + a\\,\\mathrm{sign}\\,v)\\,\\mathrm{sign}\\,v + F_v(1 + a_v\\,\\mathrm{sign}\\,v)\\,v$",
    looks_like=(
        "The error has one sign in both directions at all speeds (dry) or grows with speed squared in sign (viscous)."
    ),
    shows_over="direction",
    twins=("constant-force", "pressure-offset"),
    separate=(
        "Vent both chambers and pull the piston with a spring balance both ways; asymmetric dry friction "
        "shows at rest only as two break-away forces, a constant force moves both."
    ),
    source="lip seals; EMPS benchmark, Janot et al. 2019",
)
