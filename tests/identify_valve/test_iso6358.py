"""ISO characteristics piece by piece: which interval holds, what a curve tells of b and m, and whose command it is."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.identify.estimation.fit import Estimate
from pneucli.identify.valve import iso6358
from pneucli.identify.valve.iso6358 import Characteristic, iso_conductances
from pneucli.identify.valve.lack_of_fit import LackOfFit
from pneucli.physics.effects import catalogue
from pneucli.simulate.valve_forms.area import area_parameter_name
from tests.simulate.synthetic_experiments import VALVE, model

NOTHING: Any = object()  # of which no more is asked than that it is there
UNIT = 0.484 * np.sqrt(2.0 / (287.0 * 293.15)) / 1.185  # m^3/(s Pa) of 1 m^2


@pytest.mark.parametrize(
    ("value", "contradicted"), [(0.1, True), (0.2, False), (0.3, False), (0.4, False), (0.5, True)]
)
def test_a_characteristic_is_contradicted_by_an_interval_that_excludes_it(value: float, contradicted: bool) -> None:
    assert Characteristic(value, 0.0, 1.0, measured=(0.3, 0.2, 0.4)).is_contradicted == contradicted
    assert not Characteristic(value, 0.0, 1.0).is_contradicted


@pytest.mark.parametrize(
    ("known", "which", "seen", "interval"),
    [
        ((0.25, 0.35), 0, None, (0.25, 0.35)),
        ((0.25, 0.35), 0, (0.3, 0.2, 0.4), (0.25, 0.35)),
        ((0.25, 0.35), 0, (0.6, 0.5, 0.7), (0.25, 0.7)),
        ((0.25, 0.35), 0, (0.1, -0.05, 0.2), (0.0, 0.35)),
        (None, 0, (0.5, 0.4, 0.6), (0.3, 0.6)),
        (None, 0, None, (0.0, 0.35 + 1.959964 * 0.2)),
        (None, 1, None, (0.3, 0.5 + 1.959964 * 0.1)),
    ],
)
def test_the_models_interval_holds_unless_it_has_none_or_the_curve_contradicts_it(
    known: Any, which: int, seen: Any, interval: tuple[float, float]
) -> None:
    """Else the curve's, or what is usual (b 0.35 +- 0.2, m 0.5 +- 0.1), with the value itself, never below 0."""
    found = iso6358._characteristic(0.3, known, which, seen)
    assert (found.value, found.measured) == (0.3, seen)
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


def known_of(label: str = "valve", names: tuple[str, ...] = (), values: dict[str, float] | None = None) -> Any:
    """A law of the valve of that label, and a fit that knows all of its areas but that at -5 V, to a tenth."""
    whole = model(names, values)
    valve = replace(VALVE, label=label)
    pairs = zip(valve.commands, valve.areas, strict=True)
    areas = [estimate(area_parameter_name(u, label), a, 0.9 * a, 1.1 * a) for u, a in pairs if u != -5.0]
    return SimpleNamespace(valve=valve), SimpleNamespace(model=whole, estimates=areas)


@pytest.mark.parametrize("label", ["valve", "valve_2"])
def test_each_identified_area_gives_a_conductance_and_tested_commands_b_and_m(
    monkeypatch: pytest.MonkeyPatch, label: str
) -> None:
    law, fitted = known_of(label)
    told = [(0.2, 0.1, 0.3), (0.6, 0.5, 0.7)]
    monkeypatch.setattr(iso6358, "_measured_b_m", lambda law, lack, u, unknown: told if u > 0 else None)
    found = {one.u: one for one in iso_conductances(law, fitted, NOTHING)}
    assert sorted(found) == [-10.0, 5.0, 10.0]
    for u, area in ((-10.0, 1.8e-6), (5.0, 0.9e-6)):
        c = found[u].C
        assert c.value == pytest.approx(UNIT * area)
        assert (c.low, c.high) == (pytest.approx(0.9 * UNIT * area), pytest.approx(1.1 * UNIT * area))
    assert [(one.b.measured, one.m.measured) for one in (found[10.0], found[5.0])] == [tuple(told)] * 2
    assert (found[-10.0].b.measured, found[-10.0].m.measured) == (None, None)
    assert (found[-10.0].b.value, found[-10.0].m.value) == (model().base_values()["valve.critical_ratio"], 0.5)
    assert found[-10.0].m.low == pytest.approx(0.5 - 1.959964 * 0.1)
    assert found[-10.0].b.high == pytest.approx(0.35 + 1.959964 * 0.2)


def test_a_model_with_heat_transfer_determines_the_polytropic_index() -> None:
    values = {f"heat-transfer.{p.name}": 0.5 for p in catalogue()["heat-transfer"].parameters}
    law, fitted = known_of(names=("heat-transfer",), values=values)
    found = iso_conductances(law, fitted, None)
    assert [one.u for one in found] == [-10.0, 5.0, 10.0]
    assert found[0].C.high == pytest.approx(1.1 * found[0].C.value)
    assert found[0].b.measured is None


# --- what a curve shows


def flow(r: np.ndarray, b: float, m: float) -> np.ndarray:
    return np.asarray((1.0 - (np.maximum(r - b, 0.0) / (1.0 - b)) ** 2) ** m)


@pytest.mark.parametrize(("b", "m"), [(0.2, 0.5), (0.45, 0.6), (0.5, 0.4)])
def test_an_ellipse_is_found_from_its_points(b: float, m: float) -> None:
    r = np.linspace(0.15, 0.98, 40)
    (log_c, b_found, m_found), covariance = iso6358._fit_ellipse(3.0 * flow(r, b, m), r, np.full(40, 1e4))
    assert (np.exp(log_c), b_found, m_found) == (
        pytest.approx(3.0, rel=1e-4),
        pytest.approx(b, abs=1e-3),
        pytest.approx(m, abs=1e-3),
    )
    assert covariance.shape == (3, 3)
    coarse = iso6358._fit_ellipse(3.0 * flow(r, b, m), r, np.full(40, 1e2))[1]
    assert np.sqrt(coarse[0, 0] / covariance[0, 0]) == pytest.approx(100.0, rel=0.1)


def test_b_and_m_that_a_curve_does_not_determine_are_typical() -> None:
    r = np.linspace(0.15, 0.98, 40)
    (_, b, m), covariance = iso6358._fit_ellipse(flow(r, 0.1, 0.8), r, np.full(40, 1e-6))
    assert (b, m) == (pytest.approx(0.35, abs=1e-3), pytest.approx(0.5, abs=1e-3))
    assert np.sqrt(np.diag(covariance))[1:] == pytest.approx([0.2, 0.1], rel=1e-3)


AMBIENT, SUPPLY, B, M = 1e5, 7e5, 0.3, 0.45
PRESSURES = np.linspace(1.25e5, 6.75e5, 12)
LAW: Any = SimpleNamespace(ambient=AMBIENT, supply=SUPPLY)


def curve(u: float, drift: float = 1.0, half: float = 0.0, seen: int = 12) -> LackOfFit:
    """Gradients at u and at 1 V, ellipses of b = 0.3 and m = 0.45; the later ones smaller by ``drift``."""
    upstream, r = (SUPPLY, PRESSURES / SUPPLY) if u > 0 else (PRESSURES, AMBIENT / PRESSURES)
    measured = 2.0 * np.sign(u) * upstream * flow(r, B, M) / np.linspace(1.0, drift, 12)[:: int(np.sign(u))]
    both = np.array([measured, 0.0 * measured])
    commands, pressures = np.meshgrid([u, 1.0], PRESSURES, indexing="ij")
    covered = np.tile(np.arange(12) < seen, (2, 1))
    return LackOfFit(commands, pressures, both, 0.0 * both, both, half * np.abs(both), covered)


@pytest.mark.parametrize("u", [5.0, -5.0])
def test_a_curve_determines_b_and_m_of_its_flow(u: float) -> None:
    b, m = iso6358._measured_b_m(LAW, curve(u), u, 1.0)  # type: ignore[misc]
    assert b is not None
    assert m is not None
    assert b[0] == pytest.approx(0.3, abs=0.01)
    assert m[0] == pytest.approx(0.45, abs=0.01)
    assert b[2] - b[0] == pytest.approx(b[0] - b[1])
    wide = iso6358._measured_b_m(LAW, curve(u), u, 1.4)
    assert wide is not None
    assert wide[0] is not None
    assert wide[0][0] == pytest.approx(b[0])
    assert wide[0][2] - wide[0][1] > 2.0 * (b[2] - b[1])  # the gas may have drifted from one state to the other


def test_an_interval_holds_a_drift_of_the_gas_over_the_root_of_three() -> None:
    """A vessel that is isothermal at first and adiabatic at last: its curve is that of the law over the drift."""
    still, drifted = (iso6358._measured_b_m(LAW, curve(5.0, drift), 5.0, 1.0) for drift in (1.0, 1.0 / 1.4))
    both = iso6358._measured_b_m(LAW, curve(5.0), 5.0, 1.4)
    for one, other, wide in zip(still, drifted, both, strict=True):  # type: ignore[arg-type]
        error = np.hypot((one[2] - one[0]) / 1.959964, (other[0] - one[0]) / np.sqrt(3.0))
        assert wide[2] - wide[0] == pytest.approx(1.959964 * error, rel=1e-3)


def test_a_quarter_of_the_pressures_must_have_been_seen_at_that_command() -> None:
    for seen, told in ((2, False), (3, True)):
        assert (iso6358._measured_b_m(LAW, curve(-5.0, seen=seen), -5.0, 1.4) is not None) == told
    assert iso6358._measured_b_m(LAW, curve(5.0), 5.02, 1.4) is None  # 20 mV off


def test_an_uncertain_curve_or_one_without_flow_determines_neither() -> None:
    assert iso6358._measured_b_m(LAW, curve(5.0, half=1.0), 5.0, 1.0) == [None, None]
    assert iso6358._measured_b_m(LAW, curve(5.0), 1.0, 1.4) is None
