"""Cushions at the ends of the stroke."""

from pneucli.physics.declaration import Effect, Parameter


def force(x: float, v: float, stroke: float, length: float, damping: float) -> float:
    """Force toward +x in N: damping that grows to the end, while moving toward it only."""
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
        Parameter("length", "m", None, 1e-4, 1.0, (0.05, 0.15, 0.4), "length of each cushion", "rig.stroke"),
        Parameter("damping", "N s/m", 0.0, 0.0, 1e5, (100.0, 500.0), "damping at the very end"),
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
)
