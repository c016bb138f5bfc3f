"""Starts and restarts of a fit."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from pneucli.identify.estimation import model_fit
from pneucli.identify.estimation.fit import FULL_CONVERGENCE
from pneucli.simulate.valve_forms import ValveArea
from tests.simulate.synthetic_experiments import model

COMMANDS = (-10.0, -4.0, -1.0, 1.0, 4.0, 10.0)
AREAS = tuple(1e-8 * (abs(c) - 0.3) ** 1.2 for c in COMMANDS)


def ended(cost: float, valve: ValveArea, *, at_bound: bool) -> Any:
    """A fit that ended with a valve, of which it may say that the filling overlap stands at its bound."""
    estimate = SimpleNamespace(name="valve.overlap_fill", at_bound=at_bound, value=valve.overlap_fill)
    return SimpleNamespace(model=replace(model(), valve=valve), estimates=(estimate,), free=(), cost=cost)


STUCK = ValveArea(COMMANDS, AREAS, 0.95, 0.6)


@pytest.mark.parametrize(("cost_anew", "better"), [(10.0, True), (200.0, False)])
def test_an_overlap_that_ended_at_its_upper_bound_is_guessed_from_the_areas(
    monkeypatch: pytest.MonkeyPatch, cost_anew: float, better: bool
):
    """The areas follow a power law beyond 0.3 V, both ways; the better fit is kept."""
    started = []

    def fitted(start: Any, *_: object, **__: object) -> Any:
        started.append(start)
        return ended(cost_anew, start.valve, at_bound=False)

    monkeypatch.setattr(model_fit, "_fit_coarse_to_fine", fitted)
    found = model_fit._with_overlap_reestimated(ended(100.0, STUCK, at_bound=True), (), stopping=FULL_CONVERGENCE)
    assert started[0].valve.overlap_fill == pytest.approx(0.3, abs=0.02)
    assert started[0].valve.overlap_vent == pytest.approx(0.3, abs=0.02)
    assert (found.cost == cost_anew) == better


def test_an_overlap_within_its_bounds_is_not_reestimated():
    fit = ended(100.0, STUCK, at_bound=False)
    assert model_fit._with_overlap_reestimated(fit, (), stopping=FULL_CONVERGENCE) is fit
