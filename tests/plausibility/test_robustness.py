"""Whatever was recorded, it can be looked at: no exception, and no warning of numpy's."""

from typing import Any, get_args

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli.noise import NoiseModel
from pneucli.plausibility import findings, summarize_signal, without_empty_signals
from pneucli.plausibility.rig_check import MAX_EXCESS
from pneucli.recording import Experiment, Recording, Rig

SIGNALS = ("u", "p_supply", "p1", "p2", "x", "v", "a", "force", "temperature")
RIGS = (
    Rig(),
    Rig(vessel_volume=1e-4, supply_pressure=7e5),
    Rig(piston_area_1=8e-4, piston_area_2=7e-4, stroke=0.2, dead_volume_1=3e-5, dead_volume_2=3e-5, moving_mass=2.0),
    Rig(piston_area_1=8e-4, moving_mass=2.0, ambient_pressure=1e-3),
)


def signal(draw: st.DrawFn, n: int, rng: np.random.Generator) -> np.ndarray:
    level, size = (draw(st.sampled_from((0.0, 1e-300, 1e-3, 1.0, 1e5, -1e5, 1e160, 1e300))) for _ in range(2))
    shape = draw(st.sampled_from((np.zeros, rng.standard_normal, np.arange, lambda m: np.sin(np.arange(m) / 20))))
    values = level + size * np.asarray(shape(n), dtype=np.float64)
    return np.where(rng.random(n) < draw(st.sampled_from((0.0, 0.0, 0.5, 0.99, 1.1))), np.nan, values)


@st.composite
def recordings(draw: st.DrawFn) -> list[Recording]:
    made = []
    for k in range(draw(st.integers(1, 3))):
        n = draw(st.sampled_from((2, 5, 40, 400, 2000)))
        rng = np.random.default_rng(draw(st.integers(0, 10)))
        names = draw(st.sets(st.sampled_from(SIGNALS), min_size=1))
        more: dict[str, Any] = {
            "chamber_2": draw(st.sampled_from((None, "open", "closed", "valve"))),
            "imposed": draw(st.sampled_from((None, "motion"))),
            "noise": {name: NoiseModel(draw(st.sampled_from((0.0, 1e-3, 1e100)))) for name in sorted(names)[::2]},
        }
        time = np.cumsum(rng.uniform(0.1, 2.0, n)) * draw(st.sampled_from((1e-9, 1e-3, 1.0)))
        signals = {name: signal(draw, n, rng) for name in sorted(names)}
        made.append(Recording(f"r{k}", draw(st.sampled_from(get_args(Experiment))), "train", time, signals, **more))
    return made


@settings(max_examples=100)
@given(recordings(), st.sampled_from(RIGS))
def test_anything_can_be_looked_at(made: list[Recording], rig: Rig) -> None:
    for finding in findings(made, rig, {}):
        assert all(value for value in vars(finding).values() if isinstance(value, str))
        assert 0.0 < finding.excess <= MAX_EXCESS
        assert 0.0 <= finding.share <= 1.0
    for one in made:
        for name in without_empty_signals(one).signals:
            summarize_signal(one, name)


def test_a_signal_without_a_sample_is_missing() -> None:
    one = Recording("a", "friction", "train", np.arange(20.0), {"x": np.full(20, np.nan), "p1": np.arange(20.0)})
    assert ("missing", "x") in [(f.check, f.signal) for f in findings([one], Rig(), {})]
