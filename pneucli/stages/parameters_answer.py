"""The parameters of a model in the JSON answers."""

from __future__ import annotations

from typing import Any

from pneucli.identify.estimation.fit import Estimate


def parameters_answer(estimates: list[Estimate]) -> dict[str, Any]:
    """Return the parameters as the JSON answers hold them; an open end of an interval is null."""
    return {e.name: {"value": e.value, "unit": e.unit, "ci95": list(e.open_interval)} for e in estimates}
