"""What the valve tests do not show is told so, and never ends in a singular matrix."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.identify.effects import require_finite
from pneucli.identify.valve.fit import autocovariances, inverse
from pneucli.recording import Rig
from pneucli.simulate.model import Model


def test_a_direction_that_no_test_shows_has_no_inverse() -> None:
    found = inverse(np.array([[4.0, 0.0], [0.0, 0.0]]))
    assert found == pytest.approx(np.array([[0.25, 0.0], [0.0, 0.0]]))
    whole = np.array([[4.0, 1.0], [1.0, 2.0]])
    assert whole @ inverse(whole) == pytest.approx(np.eye(2))


def test_where_every_other_sample_is_missing_neighbours_are_not_known_to_be_alike() -> None:
    valid = (np.arange(400) % 2 == 0)[:, None]
    residual = np.random.default_rng(0).standard_normal((400, 1))
    found = autocovariances(residual, valid)
    assert np.isfinite(found).all()
    assert found[1] == 0.0
    assert found[0] == pytest.approx(1.0, abs=0.3)  # 200 samples: a variance is within 3 sqrt(2 / 200)


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
