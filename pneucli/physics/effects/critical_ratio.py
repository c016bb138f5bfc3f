"""Critical pressure ratio of the valve."""

from pneucli.physics.declaration import Effect, Parameter


def critical_ratio(b: float, critical_ratio: float) -> float:
    """Return the critical ratio of the valve's flow function in place of the gas's own.

    Args:
        b: Critical ratio of the base model.
        critical_ratio: Critical ratio of this valve.

    Returns:
        The critical ratio of the valve.

    References:
        ISO 6358-1:2013; thesis (2.42).

    >>> critical_ratio(0.528, 0.35)
    0.35
    """
    return critical_ratio


EFFECT = Effect(
    name="critical-ratio",
    title="Critical pressure ratio of the valve",
    part="valve",
    parameters=(Parameter("critical_ratio", "1", 0.528, 0.02, 0.8, (0.2, 0.35), "critical ratio b"),),
    ports={"critical_ratio": critical_ratio},
    equation="$\\Psi'(r) = 0.484\\sqrt{1 - \\left(\\frac{r-b}{1-b}\\right)^2}$ for $r > b$",
    looks_like=(
        "Charging falls off earlier than the model as the chamber nears supply pressure, discharging as "
        "it nears ambient; the flow-limited part fits."
    ),
    shows_over="p_ratio",
    twins=("supply-droop", "heat-transfer"),
    separate=("Charge and discharge slowly enough that the gas stays at wall temperature, at two supply pressures."),
    source="ISO 6358-1; thesis 2.42",
)
