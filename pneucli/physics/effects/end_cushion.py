"""Cushions at the ends of the stroke."""

from pneucli.physics.declaration import Effect, Parameter


def force(x: float, v: float, stroke: float, length: float, damping: float) -> float:
    """Return the force of the end cushions: damping that grows toward the end, against motion toward it.

    Args:
        x: Position in m.
        v: Velocity in m/s.
        stroke: Stroke in m.
        length: Length of a cushion in m.
        damping: Damping at the end in N s/m.

    Returns:
        Force toward +x in N.

    >>> round(force(0.195, 0.1, 0.2, 0.01, 400.0), 6), force(0.195, -0.1, 0.2, 0.01, 400.0)
    (-20.0, 0.0)
    """
    if v < 0.0 and x < length:
        return -damping * min((length - x) / length, 1.0) * v
    if v > 0.0 and x > stroke - length:
        return -damping * min((x - stroke + length) / length, 1.0) * v
    return 0.0


EFFECT = Effect(
    name="end-cushion",
    title="Cushions at the ends of the stroke",
    part="cylinder",
    parameters=(
        Parameter(
            "length",
            "m",
            None,
            "0.0005 strokes",
            "1 strokes",
            ("0.05 strokes", "0.15 strokes", "0.4 strokes"),
            "length of each cushion",
        ),
        Parameter(
            "damping",
            "N s/m",
            0.0,
            0.0,
            "100 supply forces per top speed",
            ("0.1 supply forces per top speed", "0.4 supply forces per top speed"),
            "damping at the very end",
        ),
    ),
    ports={"force": force},
    equation="$F = -c\\,\\frac{\\ell - s}{\\ell}\\,v$ within $s < \\ell$ of an end, moving toward it",
    looks_like=(
        "The model runs into the ends too fast; the error stands in the last millimetres, toward the end only."
    ),
    shows_over="x",
    twins=("position-friction",),
    separate="Run into each end at two speeds.",
    source="adjustable pneumatic end cushioning",
    needs=frozenset({"x"}),
)
