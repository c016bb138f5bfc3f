"""The map of a valve that filled no vessel: the model's own, fitted to a driven piston, with raw commands."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.valve.identification import ValveIdentification, identify_valve, mid_stroke_volume
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from tests.identify.test_arrangements import FIRST, FRICTION, SECOND, axis, fit
from tests.simulate.synthetic_experiments import RIG

NULL = 5.0
SPOOL = replace(RIG, valve_arrangement="5/3", valve_null=NULL)
TRUE = Model(SPOOL, (), FRICTION, FIRST, SECOND)
OPENINGS = {1: 1.0, 2: -1.0}  # of a spool whose command rises
GAS = 1.4 * 287.0 * 293.15


def swing(seconds: float = 8.0) -> np.ndarray:
    """Commands of a closed loop: never held, up to 3.3 V from the null."""
    time = 1e-3 * np.arange(round(1e3 * seconds))
    return NULL + 2.2 * np.sin(2 * np.pi * time) * (1.0 + 0.5 * np.sin(2 * np.pi * 0.23 * time))


@cache
def driven() -> tuple[list[Experiment], Fit]:
    shown = [axis(SPOOL, TRUE, swing())]
    return shown, fit(shown)


@cache
def found(chamber: int) -> ValveIdentification:
    shown, fitted = driven()
    return identify_valve(shown, fitted, 1 if chamber == 1 else 2)


def true_gradient(u: np.ndarray, p: np.ndarray, chamber: int, volume: float) -> np.ndarray:
    """Thesis 2.22, 2.42, 2.46: dp/dt of a fixed volume behind the paths of a chamber."""
    opening = OPENINGS[chamber] * (u - NULL)
    area = (FIRST if chamber == 1 else SECOND)(opening)
    fills = opening > 0
    high, low = np.where(fills, 7e5, p), np.where(fills, p, SPOOL.ambient_pressure)
    ratio = np.clip((np.minimum(low / high, 1.0) - 0.528) / 0.472, 0.0, 1.0)
    flow = area * high * np.sqrt(2 / (287.0 * 293.15)) * 0.484 * np.sqrt(1 - ratio**2)
    return GAS / volume * np.where(fills, flow, -flow)


@pytest.mark.parametrize("chamber", [1, 2])
def test_the_map_of_each_chamber_is_its_own_at_the_commands_that_went_out(chamber: int) -> None:
    one = found(chamber)
    u, p = np.meshgrid(one.map.u, one.map.p, indexing="ij")
    assert (np.diff(one.map.u) > 0).all()
    assert (one.map.u[0], one.map.u[-1]) == pytest.approx((swing().min(), swing().max()))
    truth = true_gradient(u, p, chamber, one.volume)
    covered = one.map.covered
    assert covered.any()
    off = np.abs(one.map.gradient - truth)[covered]
    assert off.max() < 0.03 * np.abs(truth).max()
    told = 0.5 * (one.map.ci_high - one.map.ci_low)[covered]
    assert np.mean(off <= 2.0 * told + 1e-9) > 0.7  # one draw of errors that go together
    assert np.median(told) < 0.02 * np.abs(truth).max()
    assert not one.measured


def test_the_volume_is_that_of_the_chamber_at_mid_stroke() -> None:
    base = TRUE.base_values()
    assert (
        mid_stroke_volume(TRUE, 2) == base["rig.dead_volume_2"] + 0.5 * base["rig.stroke"] * base["rig.piston_area_2"]
    )
    assert found(1).volume == mid_stroke_volume(TRUE, 1)


@pytest.mark.parametrize("chamber", [1, 2])
def test_the_inverse_gives_commands_and_says_what_was_not_recorded(chamber: int) -> None:
    one = found(chamber)
    u = NULL + OPENINGS[chamber] * 2.0
    asked = true_gradient(np.array(u), np.array(5e5), chamber, one.volume)
    command, reachable = one.command(np.array([asked, 5.0 * asked]), np.full(2, 5e5))
    assert command[0] == pytest.approx(u, abs=0.1)
    assert reachable.tolist() == [True, False]
    assert not one.command(asked, np.array(2e5))[1]  # the chamber never was at so low a pressure
    inverse = one.inverse
    assert (inverse.u.min(), inverse.u.max()) == pytest.approx((one.map.u[0], one.map.u[-1]))


def test_the_lack_of_fit_is_that_of_measured_gradients() -> None:
    shown, fitted = driven()
    assert found(1).lack_of_fit.median < 0.05
    assert not found(1).lack_of_fit.is_significant
    larger = replace(fitted, model=replace(fitted.model, valve=fitted.model.valve.scaled(1.25)))
    lack = identify_valve(shown, replace(larger, estimates=_scaled(fitted, 1.25)), 1).lack_of_fit
    assert lack.median == pytest.approx(0.25, abs=0.05)
    assert lack.is_significant


def _scaled(fitted: Fit, factor: float) -> tuple:
    return tuple(replace(e, value=factor * e.value) if e.name.startswith("valve.eff") else e for e in fitted.estimates)


def test_unrecorded_paths_have_no_map() -> None:
    shown, fitted = driven()
    held_out = [replace(shown[0], recording=replace(shown[0].recording, use="test"))]
    with pytest.raises(InputError, match="no flow into chamber 1"):
        identify_valve(held_out, fitted, 1)
