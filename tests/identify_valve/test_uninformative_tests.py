"""Valve tests that tell little: whatever they are, the answer has finite numbers, and says where it knows nothing."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from pneucli.errors import InputError
from pneucli.identify.estimation.model_fit import require_finite
from pneucli.identify.valve.identification import ValveIdentification
from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import simulate
from pneucli.simulate.valve_forms import ValveArea
from pneucli.stages.identify_tables import valve_findings
from tests.identify_valve.synthetic_tests import identify

LAW = (1.0, 2.0, 5.0, 10.0)
SIDES = {"both": (1.0, -1.0), "filling": (1.0,), "venting": (-1.0,)}


def bench(
    volume: float, supply: float, fill_time: float, share: float, rate: float, commands: tuple[float, ...], side: str
) -> tuple[list[Recording], Rig]:
    """One recording a command, ``share`` of the time that the open valve takes to fill the vessel."""
    rig = Rig(supply_pressure=supply, vessel_volume=volume)
    area = volume / (1.4 * np.sqrt(2 * 287 * 293.15) * 0.484 * fill_time)
    knots = tuple(area * (c / 10) ** 1.1 for c in LAW)
    valve = ValveArea((*(-c for c in LAW[::-1]), *LAW), (*knots[::-1], *knots), 0.1, 0.1)
    model = Model(rig, (), {"rig.vessel_volume": volume}, valve)
    held = int(min(max(share * fill_time, 0.08), 1500 / rate) * rate) + 4
    tests = []
    for k, command in enumerate(commands):
        levels = [0.0] + [sign * command for sign in SIDES[side]]
        u = np.repeat(levels, [10] + [held] * (len(levels) - 1))
        time = np.arange(u.size) / rate
        first = 1.013e5 if side != "venting" else supply
        still = Recording(f"{command} V", "valve", "train", time, {"u": u, "p1": np.full(u.size, first)})
        noise = NoiseModel(white=3e-4 * supply).draw(time, np.random.default_rng(k))
        p = simulate(model, prepare(still, rig, None))["p1"] + noise
        tests.append(Recording(still.name, "valve", "train", time, {"u": u, "p1": p}))
    return tests, rig


def is_sound(found: ValveIdentification) -> None:
    grid, inverse = found.map, found.inverse
    for numbers in (
        grid.gradient,
        grid.ci_low,
        grid.ci_high,
        inverse.u,
        found.lack_of_fit.model,
        found.model_gradient.covariance,
    ):
        assert np.isfinite(numbers).all()
    assert (grid.ci_low <= grid.ci_high).all()
    assert np.linalg.eigvalsh(found.model_gradient.covariance).min() > -1e-9
    for one in found.iso:
        assert np.isfinite([one.C.low, one.C.high, one.b.low, one.b.high, one.m.low, one.m.high]).all()
    told = [code for code, _ in valve_findings(found)]
    if (found.residual_to_noise("train") or 0.0) > 3.0:
        assert any(code == "valve-curves-not-followed" for code in told)
    if grid.covered.any() and np.abs(grid.gradient[grid.covered]).max() > 3.0 * found.max_measured_gradient:
        assert any(code == "valve-not-described" for code in told)


@settings(max_examples=4, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    volume=st.floats(-5.0, -1.5).map(lambda e: 10**e),
    supply=st.sampled_from([3e5, 7e5, 51e5]),
    fill_time=st.floats(-1.7, 1.5).map(lambda e: 10**e),
    share=st.floats(0.05, 4.0),
    rate=st.sampled_from([100.0, 200.0, 1000.0]),
    commands=st.sampled_from([(10.0,), (1.0,), (1.0, 10.0), (1.0, 2.0, 5.0, 10.0)]),
    side=st.sampled_from(list(SIDES)),
)
@example(0.016, 8e5, 300.0, 0.02, 100.0, (10.0,), "venting")  # a tank behind a tiny orifice
@example(1e-4, 7e5, 0.02, 1.0, 1000.0, (10.0,), "filling")  # full before the spool has settled
@example(2e-4, 7e5, 0.5, 0.16, 1000.0, (1.0, 10.0), "both")  # 80 ms a command
def test_no_valve_test_ends_in_numbers_that_are_none(
    volume: float, supply: float, fill_time: float, share: float, rate: float, commands: tuple[float, ...], side: str
) -> None:
    tests, rig = bench(volume, supply, fill_time, share, rate, commands, side)
    try:
        found = identify(tests, rig)
    except InputError:
        return
    is_sound(found)


def test_commands_that_are_held_for_a_few_readings_are_enough() -> None:
    """Five readings each at 100 Hz: fewer than a smoother may want."""
    tests, rig = bench(2e-4, 7e5, 0.3, 1.0, 100.0, LAW, "filling")
    few = [replace(r, time=r.time[5:18], signals={n: y[5:18] for n, y in r.signals.items()}) for r in tests]
    found = identify(few, rig)
    is_sound(found)
    assert found.map.covered.any()


def test_a_direction_that_was_not_tested_is_not_reachable() -> None:
    tests, rig = bench(2e-4, 7e5, 0.5, 3.0, 1000.0, (1.0, 2.0, 5.0, 10.0), "filling")
    found = identify(tests, rig)
    assert found.map.u.min() >= 0.0
    _, reachable = found.command(np.array([-8e5, 8e5]), np.array([3e5, 3e5]))
    assert reachable.tolist() == [False, True]


def test_commands_between_two_far_ones_are_not_reachable_where_one_never_was() -> None:
    tests, rig = bench(2e-4, 7e5, 0.5, 0.4, 1000.0, (1.0, 10.0), "filling")
    found = identify(tests, rig)
    reached_by_1_volt = max(tests[0]["p1"])
    above = found.map.p > reached_by_1_volt
    between = (found.map.u > 2.5) & (found.map.u < 8.5)
    assert not found.map.covered[np.ix_(between, above)].any()
    assert found.map.covered[np.ix_(between, (found.map.p > 1.5e5) & (found.map.p < reached_by_1_volt - 5e3))].all()


class Endless:
    """A view of a recording that the model has no numbers for."""

    def __init__(self, value: float) -> None:
        self.value = value
        self.experiment = type("E", (), {"recording": type("R", (), {"name": "step"})})

    def residual(self, model: Model) -> dict[str, np.ndarray]:
        return {"p1": np.array([0.0, self.value])}


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_model_without_finite_numbers_is_the_inputs_fault(value: float) -> None:
    model = Model(Rig(), (), {})
    require_finite(model, [Endless(1.0)])  # type: ignore[list-item]
    with pytest.raises(InputError, match="no finite p1 for step"):
        require_finite(model, [Endless(value)])  # type: ignore[list-item]
