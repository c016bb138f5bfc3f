"""The parameters of a model in the JSON answers."""

from __future__ import annotations

from typing import Any

from pneucli.identify.estimation.fit import Estimate


def parameters_answer(estimates: list[Estimate]) -> dict[str, Any]:
    """Return the parameters as the JSON answers hold them."""
    return {e.name: {"value": e.value, "unit": e.unit, "ci95": list(e.ci95)} for e in estimates}
