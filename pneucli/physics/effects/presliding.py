"""Elastic displacement before sliding."""

import math

import numpy as np

from pneucli.physics.declaration import Effect, Parameter, Untold
from pneucli.physics.scales import RigQuantities


def bristle_stiffness(stiffness: float, damping: float) -> float:
    """Return the stiffness of the bristles.

    Args:
        stiffness: Stiffness in N/m.
        damping: Damping in N s/m.

    Returns:
        Stiffness in N/m.

    >>> bristle_stiffness(1e5, 300.0)
    100000.0
    """
    return stiffness


def bristle_damping(stiffness: float, damping: float) -> float:
    """Return the damping of the bristles.

    Args:
        stiffness: Stiffness in N/m.
        damping: Damping in N s/m.

    Returns:
        Damping in N s/m.

    >>> bristle_damping(1e5, 300.0)
    300.0
    """
    return damping


DEFLECTIONS = (20e-6, 50e-6)  # m, of seals before they slide
DAMPING = 2e-3  # s: damping over stiffness


def _seal(rng: np.random.Generator, rig: RigQuantities) -> dict[str, float]:
    stiffness = max(rig.coulomb, 1.0) / rng.uniform(*DEFLECTIONS)
    return {"stiffness": stiffness, "damping": DAMPING * stiffness}


EFFECT = Effect(
    name="presliding",
    title="Elastic displacement before sliding",
    part="cylinder",
    parameters=(
        Parameter(
            "stiffness",
            "N/m",
            math.inf,
            "0.04 supply forces per stroke",
            "4000 supply forces per stroke",
            ("2 Coulomb forces per millimetre", "50 Coulomb forces per millimetre"),
            "stiffness of the bristles",
        ),
        Parameter(
            "damping",
            "N s/m",
            None,
            0.0,
            "10 supply forces per top speed",
            ("0.1 supply forces per top speed",),
            "damping of the bristles",
        ),
    ),
    ports={"bristle_stiffness": bristle_stiffness, "bristle_damping": bristle_damping},
    equation="$\\dot z = v - \\sigma_0 |v| z / g(v)$, $F = \\sigma_0 z + \\sigma_1 \\dot z + F_v v$",
    looks_like=(
        "The piston moves by micrometres before it breaks away, and rings against the seal when it stops; "
        "the error is a spring's, near standstill."
    ),
    shows_over="v",
    twins=("stribeck", "spring-force"),
    separate="Small slow force cycles below breakaway.",
    source="Canudas de Wit et al., IEEE TAC 40 (1995), LuGre",
    untold=Untold(_seal, apart=("friction-hysteresis", "dwell-breakaway")),
)
