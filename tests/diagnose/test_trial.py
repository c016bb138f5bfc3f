"""What a state costs: noise that a correct model would show is allowed, no less than the sensors' own."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pneucli.diagnose import costs

TIME = np.arange(4000) * 1e-3
VIEW = SimpleNamespace(channels=("force",), experiment=SimpleNamespace(time=TIME))


@pytest.mark.parametrize(
    ("rms", "expected", "left"),
    [
        (1.0, 1.0, 1.0),
        (2.0, 2.0, 1.0),
        (3.0, 1.0, 3.0),
        (3.0, 2.0, np.sqrt(9.0 - 3.0)),
        (0.95, 1.05, 0.95 / 1.05),  # the noise is known a little less well than that: in proportion
        (0.95, 0.95, 1.0),  # a model that smooths over noise leaves less of it
        (3.0, 0.9, np.sqrt(9.0 + 0.19)),
        (3.0, 0.0, np.sqrt(9.0 + 0.2)),  # nothing drawn: noise is known to four fifths
        (0.8, 2.0, np.sqrt(0.8) * 0.8),
        (1.5, 4.0, np.sqrt(0.8)),
    ],
)
def test_what_noise_explains_is_taken_off(rms: float, expected: float, left: float):
    """In squares: rms^2 - (drawn^2 - 1), in proportion where that is noise, but not below 0.8 of the sensors' 1."""
    residual = rms * np.where(np.arange(TIME.size) % 2, 1.0, -1.0)
    seen = costs.allowed([VIEW], [{"force": expected}], residual)
    assert np.sqrt(np.mean(seen**2)) == pytest.approx(left)


def test_each_channel_of_each_view_has_its_own_allowance() -> None:
    """Four channels of two views, one after the other; only the last one's noise is allowed for."""
    one, two = (SimpleNamespace(channels=c, experiment=VIEW.experiment) for c in (("p1", "p2", "x"), ("force",)))
    residual = 3.0 * np.where(np.arange(4 * TIME.size) % 2, 1.0, -1.0)
    seen = costs.allowed([one, two], [{"p1": 1.0, "p2": 1.0, "x": 1.0}, {"force": 2.0}], residual)  # type: ignore[list-item]
    parts = np.sqrt(np.mean(seen.reshape(4, -1) ** 2, axis=1))
    assert parts == pytest.approx([3.0, 3.0, 3.0, np.sqrt(6.0)])


def test_samples_that_do_not_count_stay_out():
    assert not costs.allowed([VIEW], [{"force": 2.0}], np.zeros(TIME.size)).any()
