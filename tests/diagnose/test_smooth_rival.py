"""Laws of one signal in the place of an effect: what they refuse, and what they say nothing against."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from pneucli.diagnose.equivalence import Term, nonparametric_rival
from pneucli.diagnose.smooth_term import SmoothTerm
from pneucli.diagnose.spline_regression import SplineRegression
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import effect_parameters
from pneucli.identify.residuals import ForceBalance
from pneucli.physics.effects import catalogue
from pneucli.simulate.rig_quantities import rig_quantities
from tests.diagnose.test_smooth_term import TIME
from tests.simulate.synthetic_experiments import make_experiment, model

Course = Callable[[Any], np.ndarray]
BLOCK = 250  # samples


def runs(wander: float = 5e4) -> list[ForceBalance]:
    """Balances of forces of three motions whose pressure goes with the position, but for ``wander`` in Pa."""
    residual_models = []
    for phase in range(3):
        pace = 2.1 + 0.3 * phase
        x = 0.1 + 0.06 * np.sin(pace * TIME + phase) + 0.03 * np.sin(3.7 * TIME - phase)
        v = 0.06 * pace * np.cos(pace * TIME + phase) + 0.111 * np.cos(3.7 * TIME - phase)
        p1 = 2e5 + 2e6 * x + wander * np.sin(5.3 * TIME + 2.0 * phase)
        residual_model = ForceBalance(make_experiment("friction", TIME, {"x": x, "v": v, "p1": p1}))
        residual_model.__dict__.update(noise={"force": 1.0}, channels=("force",))
        residual_models.append(residual_model)
    return residual_models


def pressed(e: Any) -> np.ndarray:
    """Dry friction that grows with the pressure, by some 10 N."""
    return np.asarray(np.sign(e.raw["v"]) * (e.raw["p1"] - 2e5) * 5e-5)


def bent(e: Any) -> np.ndarray:
    """Dry friction that grows by 25 N toward the ends of the stroke."""
    return np.asarray(np.sign(e.raw["v"]) * 2500.0 * (e.raw["x"] - 0.05) ** 2)


def spring(e: Any) -> np.ndarray:
    """A spring of 100 N/m."""
    return np.asarray(100.0 * (e.raw["x"] - 0.1))


def cogging(e: Any) -> np.ndarray:
    """A force with a pitch of 30 mm, of 12 N."""
    return np.asarray(12.0 * np.sin(2.0 * np.pi * e.raw["x"] / 0.03))


def swinging(e: Any) -> np.ndarray:
    """A force with a frequency of 11 Hz, of 3 N."""
    return np.asarray(3.0 * np.sin(70.0 * e.time))


def slight(e: Any) -> np.ndarray:
    """Dry friction that grows by 1 N over the stroke: the pressure, which wanders, would leave 1 % more than noise."""
    return np.asarray(np.sign(e.raw["v"]) * 6.0 * e.raw["x"])


def seldom(e: Any) -> np.ndarray:
    """Dry friction that grows with the position, and by 20 N more in the last 2 mm, where few blocks of time are."""
    return np.asarray(np.sign(e.raw["v"]) * (6.0 * e.raw["x"] + 20.0 * (e.raw["x"] > 0.187)))


def tried(name: str, acts: Course, residual_models: Sequence[ForceBalance], *there: Course) -> tuple[Any, Term]:
    """A bench, and an effect that ``acts`` so in its place, where other things are ``there``; noise of 1 N."""
    rng = np.random.default_rng(5)
    left = np.concatenate(
        [sum(c(v.experiment) for c in there) + rng.standard_normal(TIME.size) for v in residual_models]
    )
    own = np.concatenate([np.sign(v.experiment.raw["v"]) for v in residual_models])
    of_effect = np.concatenate([acts(v.experiment) for v in residual_models])
    effect = catalogue()[name]
    ended = model([name], {f"{name}.{p.name}": 1.0 for p in effect.parameters})
    first, *_ = effect_parameters(effect, ended, rig_quantities(ended))
    size = first.to_coordinate(1.0) - first.to_coordinate(0.0)

    def fitted(design: np.ndarray, free: Any) -> Fit:
        rest = left - design @ np.linalg.lstsq(design, left, rcond=None)[0]
        blocks = np.arange(left.size) // BLOCK
        scale = 1.0 if not free else np.linalg.lstsq(design, left, rcond=None)[0][0] / size
        return Fit(ended, free, (), rest, -design * scale, blocks, np.zeros((1, 1)), 0.0, [{}] * len(residual_models))

    base = SimpleNamespace(name="friction.coulomb")
    before, after = fitted(own[:, None], ()), fitted(np.column_stack([of_effect, own]), (first, base))
    step: Any = SimpleNamespace(effect=effect, reduced=SimpleNamespace(fit=before), full=SimpleNamespace(fit=after))
    known: dict[Any, SplineRegression] = {}

    def channel(fit: Fit, kind: Any, name: str) -> SplineRegression:
        return known.setdefault(name, SplineRegression(fit, residual_models, kind, name))

    return SimpleNamespace(train=residual_models, spline_regression=channel), Term(step, ())


def rival(name: str, acts: Course, *there: Course) -> SmoothTerm | None:
    """The law that stands better in the effect's place."""
    return nonparametric_rival(*tried(name, acts, runs(), *there))


def test_an_effect_that_resembles_an_unmodelled_one_has_a_smooth_rival() -> None:
    """A bent guide looks like a friction that grows with the pressure, where that goes with the position."""
    law = rival("pressure-friction", pressed, bent)
    assert law is not None
    assert (law.signal, law.acts_as) == ("x", "dry friction")


def test_a_simple_shape_can_be_a_rival() -> None:
    """Where the pressure follows the position closely any friction over that may be one over the pressure."""
    law = nonparametric_rival(*tried("pressure-friction", pressed, runs(3e4), bent))
    assert law is not None
    assert law.signal == "x"
    assert law.simple_shape is not None


def test_a_base_that_compensates_for_the_effect_makes_no_rival() -> None:
    """What the effect takes beside a law is held against what it takes without, from the same model.

    That it took more before the base was bent says nothing.
    """
    where, place = tried("pressure-friction", pressed, runs(), pressed, cogging)
    before = place.candidate.reduced.fit
    before.residual[:] += 200.0 * np.sin(np.arange(before.residual.size))
    assert nonparametric_rival(where, place) is None


def test_an_effect_without_a_null_is_not_in_the_span_of_a_rival() -> None:
    where, place = tried("pressure-friction", pressed, runs(), bent)
    place.candidate.full.fit.model.values["pressure-friction.gain"] = 0.0
    assert nonparametric_rival(where, place) is not None


def test_a_true_effect_has_no_rival() -> None:
    assert rival("pressure-friction", pressed, pressed) is None


def test_a_function_that_contains_the_effect_is_no_rival() -> None:
    """Any force over the position has a spring in it, which may be there beside the rest."""
    assert rival("spring-force", spring, spring, cogging) is None
    assert rival("spring-force", spring, spring, cogging, swinging) is None  # what else is there is no matter


def test_a_larger_independent_disturbance_is_no_rival() -> None:
    """A force over the position explains more than the friction does, and leaves all of that."""
    assert rival("pressure-friction", pressed, pressed, cogging, cogging) is None


def test_an_immaterially_better_function_is_no_rival() -> None:
    """1 % less than the effect leaves does not matter, however sure."""
    assert rival("pressure-friction", pressed, slight) is None


def test_a_function_that_is_better_in_few_blocks_is_no_rival() -> None:
    """Chance may have made it so there."""
    assert rival("pressure-friction", pressed, seldom) is None


def test_an_effect_without_a_reduction_has_no_rival() -> None:
    where, place = tried("pressure-friction", pressed, runs(), bent)
    place.candidate.full.fit.residual[:] *= 10.0
    assert nonparametric_rival(where, place) is None
