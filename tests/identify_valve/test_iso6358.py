"""ISO characteristics piece by piece: which interval holds, and whose command it is."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.identify.estimation.fit import Estimate
from pneucli.identify.valve import iso6358
from pneucli.identify.valve.iso6358 import iso_conductances
from pneucli.physics.effects import catalogue
from pneucli.simulate.valve_forms import area_parameter_name
from tests.simulate.synthetic_experiments import VALVE, model

UNIT = 0.484 * np.sqrt(2.0 / (287.0 * 293.15)) / 1.185  # m^3/(s Pa) of 1 m^2


@pytest.mark.parametrize(
    ("value", "known", "which", "interval"),
    [
        (0.3, (0.25, 0.35), 0, (0.25, 0.35)),
        (0.3, None, 0, (0.0, 0.35 + 1.959964 * 0.2)),
        (0.8, None, 0, (0.0, 0.8)),
        (0.3, None, 1, (0.3, 0.5 + 1.959964 * 0.1)),
    ],
)
def test_the_models_interval_holds_or_what_is_usual_with_the_value_itself(
    value: float, known: Any, which: int, interval: tuple[float, float]
) -> None:
    """Usual are b 0.35 +- 0.2 and m 0.5 +- 0.1, never below 0."""
    found = iso6358._figure(value, known, which)
    assert found.value == value
    assert (found.low, found.high) == (pytest.approx(interval[0]), pytest.approx(interval[1]))


def estimate(name: str, value: float, low: float, high: float) -> Estimate:
    return Estimate(name, "1", value, 0.0, (low, high), False)


def test_the_critical_ratio_is_the_models_with_the_interval_of_the_effect_that_identified_it() -> None:
    assert iso6358._critical_ratio(model(), {}) == (model().base_values()["valve.critical_ratio"], None)
    (parameter,) = catalogue()["critical-ratio"].parameters
    name = f"critical-ratio.{parameter.name}"
    known = model(["critical-ratio"], {name: 0.3})
    assert iso6358._critical_ratio(known, {}) == (0.3, None)
    assert iso6358._critical_ratio(known, {name: estimate(name, 0.3, 0.25, 0.4)}) == (0.3, (0.25, 0.4))


@pytest.mark.parametrize("label", ["valve", "valve_2"])
def test_each_identified_area_gives_a_conductance(label: str) -> None:
    """All areas but that at -5 V are known, to a tenth."""
    valve = replace(VALVE, label=label)
    pairs = zip(valve.commands, valve.areas, strict=True)
    areas = [estimate(area_parameter_name(u, label), a, 0.9 * a, 1.1 * a) for u, a in pairs if u != -5.0]
    fitted: Any = SimpleNamespace(model=model(), estimates=areas)
    found = {one.u: one for one in iso_conductances(valve, fitted)}
    assert sorted(found) == [-10.0, 5.0, 10.0]
    for u, area in ((-10.0, 1.8e-6), (5.0, 0.9e-6)):
        c = found[u].C
        assert c.value == pytest.approx(UNIT * area)
        assert (c.low, c.high) == (pytest.approx(0.9 * UNIT * area), pytest.approx(1.1 * UNIT * area))
    assert (found[-10.0].b.value, found[-10.0].m.value) == (model().base_values()["valve.critical_ratio"], 0.5)
    assert found[-10.0].m.low == pytest.approx(0.5 - 1.959964 * 0.1)
    assert found[-10.0].b.high == pytest.approx(0.35 + 1.959964 * 0.2)
