"""Sentences about identified friction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pneucli.messages.formatting import format_number, format_quantity

PLAIN = {
    "one-direction": "motion in one direction only: a constant force cannot be distinguished from dry friction",
    "mass-not-identifiable": (
        "these recordings do not identify the moving mass: inertia is neglected, a22 is that of 1 kg"
    ),
    "dry-friction-not-significant": "dry friction is not significantly above zero",
    "static-friction-uncertain": (
        "the Stribeck velocity lies near the end of the measured velocities: static friction is uncertain"
    ),
}


def friction_warning(kind: str, values: Mapping[str, Any]) -> str:
    """Word a warning about identified friction.

    Args:
        kind: Its kind, see ``pneucli.identify.friction.warnings``.
        values: The values and names of that kind.

    Returns:
        The sentence.

    """
    if kind in PLAIN:
        return PLAIN[kind]
    return WORDED[kind](values)


def _models_missing(values: Mapping[str, Any]) -> str:
    counts = ", ".join(f"{count} {branch}" for branch, count in values["samples"].items())
    return f"no model {', '.join(values['models'])}: too few moving samples ({counts})"


def _force_offset(values: Mapping[str, Any]) -> str:
    force = format_quantity(values["force"], "N", 3)
    otherwise = "or friction differs by direction, or a sensor or an area is wrong"
    return f"a constant force of {force} acts in addition to friction ({otherwise})"


def _misfit(values: Mapping[str, Any]) -> str:
    ratio = f"model A leaves {values['ratio']:.1f} times the sensors' noise of these forces"
    if not values["unmodelled"]:
        return (
            f"{ratio}: neither A, a function of velocity alone, nor the pipeline's effects describe it; if D, E or F "
            "leave less, friction differs between acceleration and deceleration; else run pneucli diagnose"
        )
    better = values["better"]
    others = f"{' and '.join(better)} can represent more of it" if better else "none of A to F can"
    effects = ", ".join(values["unmodelled"])
    return f"{ratio}: A, a function of velocity alone, cannot represent {effects} of the pipeline's model; {others}"


def _levels_differ(values: Mapping[str, Any]) -> str:
    spread = f"{format_number(values['lowest'], 3)} to {format_quantity(values['highest'], 'N', 3)}"
    return f"kinetic friction differs between recordings ({spread}): model A pools them; see the level of each"


WORDED = {
    "models-missing": _models_missing,
    "force-offset": _force_offset,
    "misfit": _misfit,
    "levels-differ": _levels_differ,
}
