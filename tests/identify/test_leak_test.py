"""The leak of a shut vessel: against an energy balance of its own, with and without a gas that is still warm."""

import numpy as np
import pytest

from pneucli.arrays import Array
from pneucli.identify.leak_test import LeakFit, fit_leak, shut_stretch

AMBIENT, WALL, R = 1.013e5, 293.15, 287.0


def decay(
    rate: float,
    law: str = "laminar",
    *,
    first: float = 7e5,
    warmed: float = 0.0,
    seconds: float = 120.0,
    noise: float = 50.0,
) -> tuple[Array, Array]:
    """Return times and pressures of a litre that leaks ``rate`` (Pa/s) at ``first``, with walls that take up heat."""
    step, volume, conductance = 0.02, 1e-3, 0.5
    heat, mass = WALL + warmed, first * 1e-3 / (R * WALL)
    pressures = []
    for _ in range(int(seconds / step)):
        p = mass * R * heat / volume
        pressures.append(p)
        laminar = (p**2 - AMBIENT**2) / (first**2 - AMBIENT**2)
        share = laminar if law == "laminar" else np.sign(laminar) * np.sqrt(abs(laminar))
        flow = rate * share * volume / (R * WALL)
        carried = flow * R * heat if flow > 0.0 else flow * (1004.5 * WALL - 717.5 * heat)
        heat += step * (-carried + conductance * (p / first) ** 0.6 * (WALL - heat)) / (mass * 717.5)
        mass -= step * flow
    time = step * np.arange(len(pressures))
    measured = np.array(pressures) + noise * np.random.default_rng(3).standard_normal(time.size)
    return time[::5].astype(float), measured[::5].astype(float)


def fitted(time: Array, p: Array, drift: float = 0.02) -> LeakFit:
    return fit_leak(time, p, AMBIENT, temperature=WALL, volume=1e-3, drift=drift)


@pytest.mark.parametrize("law", ["laminar", "orifice"])
@pytest.mark.parametrize("rate", [20.0, 1500.0])
def test_the_interval_holds_the_true_rate_and_is_narrow(rate: float, law: str) -> None:
    found = fitted(*decay(rate, law))
    low, high = (end * rate / found.rate.value for end in (found.rate.low, found.rate.high))
    at_first = rate * ((found.pressure**2 - AMBIENT**2) / (7e5**2 - AMBIENT**2)) ** (1.0 if law == "laminar" else 0.5)
    assert not found.rate.excludes(at_first)
    assert high - low < 0.3 * rate + 5.0


def test_a_warm_gas_is_no_leak() -> None:
    time, p = decay(0.0, warmed=12.0)
    assert p[0] - p[-1] > 2.5e4
    found = fitted(time, p)
    assert found.rate.low <= 0.0 <= found.rate.high < 20.0
    assert found.warmed == pytest.approx(12.0, rel=0.2)
    assert found.law == "cannot tell"


@pytest.mark.parametrize("law", ["laminar", "orifice"])
def test_a_long_decay_tells_the_law(law: str) -> None:
    assert fitted(*decay(8000.0, law, seconds=90.0, noise=20.0)).law == law


def test_a_short_decay_tells_no_law() -> None:
    assert fitted(*decay(20.0)).law == "cannot tell"


def test_an_unknown_drift_of_the_wall_widens_the_interval() -> None:
    time, p = decay(20.0, seconds=60.0)
    narrow, wide = fitted(time, p, 0.01).rate, fitted(time, p, 0.5)
    drifted = 1.96 * 0.5 / WALL * 7e5 / 60.0
    assert wide.drift == pytest.approx(drifted, rel=0.1)
    assert wide.rate.high - wide.rate.low > 1.7 * drifted > 3.0 * (narrow.high - narrow.low)


def test_a_vacuum_leaks_inward() -> None:
    found = fitted(*decay(-100.0, first=2e4, noise=10.0))
    assert found.rate.low < -99.5 < found.rate.high < -90.0


def test_the_shut_stretch_is_what_falls_by_itself() -> None:
    time = np.arange(0.0, 100.0, 0.1)
    p = AMBIENT + np.interp(time, [0.0, 5.0, 8.0, 30.0, 90.0, 91.0, 100.0], [0.0, 0.0, 6e5, 6e5, 5.5e5, 0.0, 0.0])
    p += 50.0 * np.random.default_rng(1).standard_normal(time.size)
    found = shut_stretch(p, AMBIENT)
    assert found is not None
    assert 28.0 < time[found.start] < 32.0
    assert 88.0 < time[found.stop - 1] < 91.0
    assert 7.0 < time[found.rest] < 10.0


def test_a_command_that_changes_ends_the_stretch() -> None:
    time = np.arange(0.0, 100.0, 0.1)
    p = 6e5 - 100.0 * time + 50.0 * np.random.default_rng(1).standard_normal(time.size)
    found = shut_stretch(p, AMBIENT, np.where(time < 40.0, 5.0, 0.0))
    assert found is not None
    assert 39.0 < time[found.start] < 41.0


def test_nothing_leaks_at_ambient() -> None:
    assert shut_stretch(AMBIENT + 50.0 * np.random.default_rng(1).standard_normal(500), AMBIENT) is None
