"""A pump or compressor, whose flow falls with the pressure that it works against."""

from pneucli.physics.declaration import Effect, Parameter


def filling(q: float, full: float, p: float, p_amb: float, slip: float, clearance: float) -> float:
    """Return the mass flow of a pump in place of that of an orifice.

    A motor at constant voltage slows down with its load, and gaps leak by the pressure difference whatever the speed:
    ``slip``. Gas left in the clearance expands in each stroke: that loss goes with the speed. Valves of the pump keep
    gas from flowing back.

    Args:
        q: Mass flow through an orifice from the supply in kg/s, which it replaces.
        full: Mass flow at this command against ambient pressure in kg/s.
        p: Pressure of the chamber in Pa.
        p_amb: Ambient pressure in Pa.
        slip: Mass flow lost per pressure difference in kg/(s Pa).
        clearance: Share of the flow lost to gas left in the clearance, per bar of the pressure difference.

    Returns:
        Mass flow in kg/s, at least 0.

    >>> round(filling(0.0, 2e-4, 2e5, 1e5, 5e-10, 0.0), 6), filling(0.0, 4e-5, 2e5, 1e5, 5e-10, 0.0)
    (0.00015, 0.0)
    >>> round(filling(0.0, 2e-4, 2e5, 1e5, 0.0, 0.25), 6)
    0.00015
    """
    above = p - p_amb
    return max(full * (1.0 - clearance * above * 1e-5) - slip * above, 0.0)


EFFECT = Effect(
    name="pump-flow",
    title="Pump whose flow falls with the pressure",
    part="pump",
    parameters=(
        Parameter(
            "slip",
            "kg/(s Pa)",
            None,
            0.0,
            "20 valve conductances",
            ("0.05 valve conductances", "0.5 valve conductances"),
            "flow lost per pressure difference, at any speed",
        ),
        Parameter(
            "clearance",
            "1/bar",
            None,
            0.0,
            "5 per supply pressure",
            ("0.2 per supply pressure", "0.8 per supply pressure"),
            "share of the flow lost per bar, at any speed alike",
        ),
    ),
    ports={"filling": filling},
    equation="$q = \\max\\left(q_0(u)\\,(1 - c\\,(p - p_{amb})) - s\\,(p - p_{amb}),\\, 0\\right)$",
    looks_like=(
        "While filling, the flow falls from the start in a straight line, where an orifice keeps it up to half of the "
        "supply pressure; a weak command ends at a low pressure."
    ),
    shows_over="p1",
    twins=("chamber-leak", "laminar-leak", "supply-droop"),
    separate="Stop the pump at several pressures and hold: a leak goes on, slip does not.",
    source=(
        "W. E. Wilson, Trans. ASME 71 (1949) 115 (slip by the pressure difference, whatever the speed); "
        "volumetric efficiency of reciprocating compressors, linear in the pressure (clearance)"
    ),
    nested=False,
)
