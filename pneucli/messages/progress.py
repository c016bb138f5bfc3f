"""The progress line of a stage."""

from __future__ import annotations


def screening_progress(effect: str, remaining: int) -> str:
    """Return that the score test of an effect runs, and how many effects remain."""
    return f"screening {effect}, {remaining} left"


def fitting_progress(effect: str) -> str:
    """Return that a fit with an effect runs."""
    return f"fitting {effect}"


def fitted_progress(effect: str) -> str:
    """Return that a worker has finished a fit with an effect."""
    return f"fitted {effect}"


GIVEN_MODEL_PROGRESS = "fitting the given model"
FREE_RUN_PROGRESS = "comparing the free run"
BASELINE_PROGRESS = "fitting all recordings"
