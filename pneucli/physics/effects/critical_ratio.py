"""Critical pressure ratio of the valve."""

from pneucli.physics.declaration import Effect, Parameter


def critical_ratio(b: float, critical_ratio: float) -> float:
    """Critical ratio b of the valve's flow function (ISO 6358-1)."""
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
