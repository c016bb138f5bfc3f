"""A play of the valve: a model without it takes the play for overlap, and must give it back."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pneucli.recording import Recording
from tests.identify_valve.synthetic_tests import NOISE, OVERLAP, RIG, fitted, true_gradient

HELD = 300  # samples of a level
STEPS = [(0.0, u, u, u, 0.0, -u, -u, -u) for u in (0.5, 1.0, 2.0, 5.0, 10.0)]
STAIRS = [(0.5, 1.0, 1.5, 1.0, 0.5, -0.5, -1.0, -1.5, -1.0, -0.5), (0.6, 2.0, 0.6, -0.6, -2.0, -0.6)]


def recorded(levels: Sequence[float], play: float, seed: int) -> Recording:
    """Held commands behind a play; the play operator is written out here, apart from the package's own."""
    time = 1e-3 * np.arange(HELD * len(levels))
    p, start, opening = np.empty(time.size), RIG.ambient_pressure, 0.0
    for k, u in enumerate(levels):
        opening = min(max(opening, u - play), u + play)
        span = 1e-3 * np.arange(HELD + 1)
        right = lambda _, q, v=opening: true_gradient(v, q)  # noqa: E731
        found = solve_ivp(right, (0.0, span[-1]), [start], t_eval=span, rtol=1e-7, atol=1.0, max_step=0.02)
        p[HELD * k : HELD * (k + 1)], start = found.y[0][:-1], found.y[0][-1]
    rng = np.random.default_rng(seed)
    supply = np.full(time.size, RIG.supply_pressure) + NOISE.draw(time, rng)
    signals = {"u": np.repeat(levels, HELD), "p_supply": supply, "p1": p + NOISE.draw(time, rng)}
    return Recording(f"test_{seed}", "valve", "train", time, signals)


@pytest.mark.parametrize("play", [0.15, 0.2, 0.28])
def test_a_play_is_given_back_by_the_overlap_that_the_model_without_it_took_for_it(play: float) -> None:
    """Behind both, the smallest commands open nothing whatever the overlap, where a fit would stay."""
    found = fitted([recorded(levels, play, k) for k, levels in enumerate([*STEPS, *STAIRS])], RIG, ["valve-hysteresis"])
    assert found["valve-hysteresis.half_width"].value == pytest.approx(play, abs=0.005)
    for side in ("fill", "vent"):
        assert found[f"valve.overlap_{side}"].value == pytest.approx(OVERLAP, abs=0.07)
    residual = found.residual[found.residual != 0.0]
    assert np.sqrt(np.mean(residual**2)) < 1.15  # times the noise
