"""``identify`` names the recordings whose imposed motion scatters more than the noise of its sensor."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate.preparation import prepare
from pneucli.stages.identify import _smoothing_warnings


@pytest.mark.parametrize("digits", [4, 9])
def test_a_text_with_few_digits_is_named(digits: int) -> None:
    time = 2e-3 * np.arange(4000)
    x = np.array([float(f"{value:.{digits}g}") for value in np.pi * time])
    noise = {"x": NoiseModel(2e-5, period=2e-3), "force": NoiseModel(0.1, period=2e-3)}
    signals = {"x": x, "force": 20.0 + 0.1 * np.random.default_rng(0).standard_normal(time.size)}
    recording = Recording("p60", "friction", "train", time, signals, noise, imposed="motion")
    said = _smoothing_warnings([prepare(recording, Rig(), None)])
    assert [text.partition(":")[0] for text in said] == ["p60"] * (digits == 4)
