"""A stretch of the stroke with more friction."""

import numpy as np

from pneucli.physics.declaration import Effect, Parameter, Untold
from pneucli.physics.scales import RigQuantities

EDGE_STEP = "0.005 strokes"  # a fit must move an edge by as much, to have readings on both of its sides


def dry_factor(
    direction: float, x: float, p1: float, p2: float, p_amb: float, start: float, end: float, gain: float
) -> float:
    """Return the factor on dry friction at a position.

    Args:
        direction: 1 toward +x, -1 toward -x.
        x: Position in m.
        p1: Pressure of chamber 1 in Pa.
        p2: Pressure of chamber 2 in Pa.
        p_amb: Ambient pressure in Pa.
        start: Position in m where the section begins.
        end: Position in m where it ends.
        gain: Relative growth of dry friction in it.

    Returns:
        Factor on dry friction.

    >>> dry_factor(1.0, 0.05, 2e5, 2e5, 1e5, 0.04, 0.06, 0.5)
    1.5
    """
    return 1.0 + gain if start <= x <= end else 1.0


def _weak_place(rng: np.random.Generator, rig: RigQuantities) -> dict[str, float]:
    begin = rng.uniform(0.0, 0.8) * rig.stroke
    return {"from": begin, "to": begin + 0.2 * rig.stroke, "gain": rng.uniform(0.0, 0.5)}


EFFECT = Effect(
    name="position-friction",
    title="A stretch of the stroke with more friction",
    part="cylinder",
    parameters=(
        Parameter(
            "from",
            "m",
            None,
            "0 ranges of x",
            "1 ranges of x",
            tuple(f"{share} ranges of x" for share in (0.0, 0.15, 0.3, 0.45, 0.6, 0.75)),
            "start of the stretch",
            EDGE_STEP,
        ),
        Parameter(
            "to",
            "m",
            None,
            "0 ranges of x",
            "1 ranges of x",
            tuple(f"{share} ranges of x" for share in (0.2, 0.35, 0.5, 0.65, 0.8, 1.0)),
            "end of the stretch",
            EDGE_STEP,
        ),
        Parameter("gain", "1", 0.0, -0.95, 20.0, (1.0,), "growth of dry friction in it", multiplies="friction.coulomb"),
    ),
    ports={"dry_factor": dry_factor},
    equation="$F_{dry}(1 + k)$ for $x_{from} \\le x \\le x_{to}$",
    looks_like=(
        "The error stands at a stretch of the stroke, in both directions of motion, with the sign of the velocity."
    ),
    shows_over="x",
    twins=("pressure-friction",),
    separate="One slow pass over the whole stroke in each direction at constant pressure.",
    source="wear or a tight stretch of the bore",
    needs=frozenset({"x"}),
    untold=Untold(_weak_place),
)
