"""First-order lag of the pressure sensors."""

from pneucli.physics.declaration import Effect, Parameter, Untold


def sensor_lag(time_constant: float) -> float:
    """Return the time constant of the sensors of p1 and p2.

    Args:
        time_constant: Time constant in s.

    Returns:
        The time constant in s.

    >>> sensor_lag(2e-3)
    0.002
    """
    return time_constant


EFFECT = Effect(
    name="pressure-lag",
    title="First-order lag of the pressure sensors",
    part="sensor",
    parameters=(
        Parameter(
            "time_constant",
            "s",
            0.0,
            0.0,
            "0.5 horizons",
            ("0.01 response times", "0.03 response times"),
            "time constant of the sensors",
            stated="lag",
        ),
    ),
    ports={"sensor_lag": sensor_lag},
    equation="$\\tau \\dot p_{read} = p - p_{read}$",
    looks_like=("The pressure readings follow late, in charging as in motion, and so does the other chamber's."),
    shows_over="p1",
    twins=("valve-lag", "line-delay", "time-skew"),
    separate="Burst a foil or open a ball valve on the sensor: the reading's own step response.",
    source="sensor hose and electronics, first order",
    untold=Untold(lambda rng, rig: {"time_constant": rng.uniform(0.0, 2e-3)}),
)
