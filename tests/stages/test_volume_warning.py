"""A stated volume of a vessel that the recorded flow contradicts."""

from __future__ import annotations

from pneucli.identify.estimation.fit import Estimate
from pneucli.recording import Rig
from pneucli.stages.identify import _volume_warnings


def estimate(value: float, low: float, high: float) -> list[Estimate]:
    return [Estimate("rig.vessel_volume", "m^3", value, 0.5 * (high - low), (low, high), at_bound=False)]


def test_a_stated_volume_outside_the_interval_is_reported() -> None:
    (warning,) = _volume_warnings(Rig(vessel_volume=951e-6), estimate(808e-6, 801e-6, 816e-6))
    assert "808 cm^3 [801, 816]" in warning
    assert "951 cm^3" in warning


def test_a_stated_volume_within_the_interval_is_not() -> None:
    assert _volume_warnings(Rig(vessel_volume=805e-6), estimate(808e-6, 801e-6, 816e-6)) == []
    assert _volume_warnings(Rig(), estimate(808e-6, 801e-6, 816e-6)) == []
    assert _volume_warnings(Rig(vessel_volume=951e-6), []) == []
