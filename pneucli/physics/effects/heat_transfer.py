"""Heat transfer between gas and wall."""

from pneucli.physics.declaration import Effect, Parameter


def heat(T: float, T_wall: float, conductance: float, sensor_time_constant: float) -> float:
    """Return the heat flow into the gas by Newton's law, with one conductance for every chamber.

    Args:
        T: Gas temperature in K.
        T_wall: Wall temperature in K.
        conductance: Thermal conductance in W/K.
        sensor_time_constant: Time constant of the sensor of the gas temperature in s.

    Returns:
        Heat flow in W.

    >>> heat(273.0, 293.0, 0.5, 0.3)
    10.0
    """
    return conductance * (T_wall - T)


def temperature_lag(conductance: float, sensor_time_constant: float) -> float:
    """Return the time constant of the sensor of the gas temperature.

    Args:
        conductance: Thermal conductance in W/K.
        sensor_time_constant: Time constant in s.

    Returns:
        The time constant in s.

    >>> temperature_lag(0.5, 0.3)
    0.3
    """
    return sensor_time_constant


EFFECT = Effect(
    name="heat-transfer",
    title="Heat transfer between gas and wall",
    part="gas",
    parameters=(
        Parameter(
            "conductance",
            "W/K",
            None,
            "0.0003 gas conductances",
            "1000 gas conductances",  # the gas is isothermal to 0.04 % of its pressure
            ("0.03 gas conductances", "0.15 gas conductances", "0.7 gas conductances"),
            "heat conductance gas to wall",
        ),
        Parameter(
            "sensor_time_constant",
            "s",
            None,
            0.0,
            30.0,
            (0.3,),
            "time constant of a sensor of the gas temperature",
            refines=True,
            unrefined=0.0,
            needs=frozenset({"temperature"}),
        ),
    ),
    ports={"heat": heat, "temperature_lag": temperature_lag},
    equation=(
        "$\\dot Q = G (T_w - T)$; $\\dot p = \\frac{\\kappa}{V}(R T_{in} q_{in} - R T q_{out} - p A v) + "
        "\\frac{\\kappa-1}{V}\\dot Q$, with $T$ from the mass balance."
    ),
    looks_like=(
        "After a fast charge the pressure sags back while the valve is shut, after a fast discharge it "
        "creeps up; the gradient over pressure is no longer a straight line."
    ),
    shows_over="p1",
    twins=("critical-ratio", "chamber-leak"),
    separate=(
        "Charge fast, shut the valve and hold for 30 s: heat transfer settles exponentially, a leak goes "
        "on. Or record the gas temperature."
    ),
    source="thesis 2.1.3; Carneiro and de Almeida, Proc. IMechE I 220 (2006)",
    nested=False,
)
