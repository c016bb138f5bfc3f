"""What is left of a diagnosis after the search: evidence, costs, equals, what moved, and what would have shown."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import f as fisher

from pneucli.diagnose import data as data_module
from pneucli.diagnose import diagnosis as visible
from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.diagnosis import _parameter_shifts
from pneucli.diagnose.equivalence import not_inferior
from pneucli.diagnose.evidence import (
    effective_degrees_of_freedom,
    holm_adjusted,
    score_gain,
    significance,
    wald_p_value,
)
from pneucli.diagnose.score import ChannelCost, FittedModel
from pneucli.identify.estimation.fit import Estimate, Fit
from pneucli.identify.estimation.parameters import effect_parameters
from pneucli.messages.diagnose import Shift
from pneucli.physics.effects import catalogue
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.stages import answer_parts
from pneucli.stages.diagnosis_answer import detection_limit, parameter_shift
from tests.simulate.synthetic_experiments import model

RNG = np.random.default_rng
N = 4000
BLOCKS = np.arange(N) // 50


# --- gains


def test_a_gain_is_its_bootstraps_lower_five_percent() -> None:
    fall = 10.0 + RNG(1).normal(scale=5.0, size=60)
    found = score_gain(fall, np.zeros(60))
    error = np.std(fall) * np.sqrt(60)
    assert found.total == pytest.approx(fall.sum())
    assert found.lower_95 == pytest.approx(fall.sum() - 1.645 * error, abs=0.15 * error)


def test_the_chance_is_a_paired_t_test_over_the_blocks_that_matter() -> None:
    from scipy.stats import t as student

    fall = 1.0 + RNG(2).normal(scale=5.0, size=60)
    found = score_gain(fall, np.zeros(60))
    statistic, freedom = (
        fall.mean() / (np.std(fall, ddof=1) / np.sqrt(60)),
        effective_degrees_of_freedom(fall - fall.mean()),
    )
    assert found.p_value == pytest.approx(student.sf(statistic, freedom))
    assert score_gain(np.zeros(60), fall).p_value == pytest.approx(1.0 - found.p_value)


@pytest.mark.parametrize(("fall", "low"), [([5.0], 0.0), ([-5.0], -5.0), ([], 0.0)])
def test_one_block_is_never_certain(fall: list[float], low: float) -> None:
    found = score_gain(np.array(fall), np.zeros(len(fall)))
    assert (found.total, found.lower_95, found.p_value) == (sum(fall), low, 1.0)
    assert not found.significant


def test_a_family_is_adjusted_step_by_step() -> None:
    """Holm: the smallest times the family, the next times one less, never falling."""
    assert holm_adjusted([0.01, 0.02, 0.02], 10) == pytest.approx([0.1, 0.18, 0.18])
    assert holm_adjusted([0.5, 0.01], 2) == pytest.approx([0.5, 0.02])
    assert holm_adjusted([], 0) == []


# --- Wald


def ended(name: str, values: dict[str, float], columns: np.ndarray, left: np.ndarray) -> Fit:
    one = catalogue()[name]
    model_ = model([name], {f"{name}.{n}": v for n, v in values.items()})
    free = tuple(effect_parameters(one, model_, rig_quantities(model_)))
    unused = np.zeros((len(free), len(free)))
    return Fit(model_, free, (), left, columns, BLOCKS, unused, float(left @ left), ())


@pytest.mark.parametrize(("name", "size", "half"), [("constant-force", 10.0, 1.0), ("chamber-leak", 1e-8, 0.5)])
def test_a_parameter_is_tested_by_its_distance_from_null_over_the_error_of_blocks(
    name: str, size: float, half: float
) -> None:
    """Halved where the null is a bound: a leak cannot be negative, a force can."""
    wave, noise = 0.02 * np.sin(np.arange(N) / 40.0), RNG(3).normal(size=N)
    parameter = catalogue()[name].parameters[0].name
    found = ended(name, {parameter: size}, wave[:, None], noise - wave * (wave @ noise) / (wave @ wave))
    scores = np.bincount(BLOCKS, wave * found.residual) / (wave @ wave)
    distance = size / found.free[0].scale
    statistic = distance**2 / float(scores @ scores)
    wanted = half * fisher.sf(statistic, 1, effective_degrees_of_freedom(scores))
    assert wald_p_value(found, catalogue()[name]) == pytest.approx(wanted, rel=1e-6)
    assert significance(found, catalogue()[name]) == pytest.approx(math.sqrt(statistic), rel=1e-6)


def test_two_parameters_are_tested_together() -> None:
    """Asymmetry of dry and of viscous friction, of which neither is certain alone; both nulls are zero."""
    t = np.arange(N) / 40.0
    columns = 0.035 * np.column_stack([np.sin(t), np.cos(t)])
    noise = RNG(4).normal(size=N)
    left = noise - columns @ np.linalg.lstsq(columns, noise, rcond=None)[0]
    both = ended("friction-asymmetry", {"asymmetry": 0.2, "viscous_asymmetry": 0.2}, columns, left)
    none = ended("friction-asymmetry", {"asymmetry": 0.0, "viscous_asymmetry": 0.0}, columns, left)
    assert wald_p_value(both, catalogue()["friction-asymmetry"]) < 0.2
    assert wald_p_value(none, catalogue()["friction-asymmetry"]) == pytest.approx(1.0)


def test_an_effect_without_fitted_parameters_has_no_test() -> None:
    found = replace(ended("constant-force", {"force": 1.0}, np.ones((N, 1)), np.ones(N)), free=())
    found = replace(found, jacobian=np.zeros((N, 0)))
    assert math.isnan(wald_p_value(found, catalogue()["constant-force"]))
    assert significance(found, catalogue()["constant-force"]) == 0.0


def test_without_a_null_the_significance_is_that_of_the_first_parameter() -> None:
    found = ended("heat-transfer", {"conductance": 0.6}, np.ones((N, 1)), np.ones(N))
    estimate = Estimate("heat-transfer.conductance", "W/K", 0.6, 0.1, (0.4, 0.8), False)
    assert significance(replace(found, estimates=(estimate,)), catalogue()["heat-transfer"]) == pytest.approx(6.0)


# --- the data of a diagnosis


def model_fit(train: list[float], test: list[float] | None = None, **more: Any) -> FittedModel:
    fit: Any = SimpleNamespace(residual=np.array([1.0, 0.0, 2.0]), model=SimpleNamespace(effects=()), **more)
    costs = np.array([*train, *(test or [])])
    return FittedModel(fit, np.array(train), np.array(test or []), costs, np.ones(costs.size))


def diagnosis_data(**given: Any) -> DiagnosisData:
    return DiagnosisData(**{"train": [], "held_out": [], "effects": {}, **given})


ONE: Any = SimpleNamespace(name="one", part="valve", balances=frozenset({"gas"}), main_parameters=(1, 2))
TWO: Any = SimpleNamespace(name="two", part="cylinder", balances=frozenset({"gas"}), main_parameters=(1,))
THREE: Any = SimpleNamespace(name="three", part="gas", balances=frozenset({"gas"}), main_parameters=(1, 2, 3))


def seen(*names: str) -> Any:
    return SimpleNamespace(
        is_sensitive_to=lambda effect: effect.name in names, exclusive_channels=lambda effect: (), predicts_force=False
    )


def test_the_family_is_all_parameters_of_the_effects_that_can_show() -> None:
    found = diagnosis_data(train=[seen("one"), seen("two")], effects={e.name: e for e in (ONE, TWO, THREE)})
    assert found.hypothesis_count == 3
    assert [found.is_observable(e) for e in (ONE, TWO, THREE)] == [True, True, False]


def test_an_effect_of_a_modelled_part_is_not_observable() -> None:
    found = diagnosis_data(
        train=[seen("one", "two")], effects={"one": ONE, "two": TWO}, modelled_parts=frozenset({"valve"})
    )
    assert not found.is_observable(ONE)
    assert found.hypothesis_count == 1


def test_the_sensitive_cost_is_that_of_the_sensitive_residual_models() -> None:
    """Two fitted views of two blocks and one held out of one block, which alone has two channels."""
    residual_models = [seen("one", "two"), seen("one"), seen("two")]
    for residual_model, end in zip(residual_models, (0.3, 0.3, 0.1), strict=True):
        residual_model.experiment, residual_model.channels = SimpleNamespace(time=np.array([0.0, end])), ("force",)
    residual_models[2].channels = ("p1", "p2")
    found = diagnosis_data(train=residual_models[:2], held_out=residual_models[2:], effects={})
    train, test = np.array([1.0, 2.0, 4.0, 8.0]), np.array([16.0])
    fit: Any = SimpleNamespace(model=None)
    channels = tuple(ChannelCost(*one) for one in [(3.0, 7.0), (12.0, 3.0), (5.0, 4.0), (11.0, 5.0)])
    fitted = FittedModel(fit, train, test, np.concatenate([train, test]), np.array([4, 3, 2, 1, 9]), channels)
    assert found.sensitive_blocks(ONE).tolist() == [True] * 4 + [False]
    assert found.sensitive_cost(fitted, ONE) == (15.0, 10)
    assert found.sensitive_cost(fitted, TWO) == (3.0, 7)
    costs = {
        n: {k: [c[:2] for c in v] for k, v in found.recording_costs(fitted, e).items()}
        for n, e in (("one", ONE), ("two", TWO))
    }
    assert costs == {
        "one": {"force": [(3.0, 7.0), (12.0, 3.0)]},
        "two": {"force": [(3.0, 7.0)], "p1": [(5.0, 4.0)], "p2": [(11.0, 5.0)]},
    }


def test_exclusive_channels_have_their_own_cost_and_count() -> None:
    """Of noise 2: readings 4 and 0 (none) are four squares of one, 2, 2, 2 three of three."""

    def reading(values: list[float]) -> Any:
        read = {"a": np.array(values), "force": np.full(len(values), 99.0)}
        alone = {"one": ("a",), "two": ()}
        return SimpleNamespace(
            residual=lambda model: read if model == "fitted" else {},
            noise={"a": 2.0, "force": 1.0},
            exclusive_channels=lambda effect: alone[effect.name],
        )

    none = np.zeros(0)
    fitted = FittedModel(SimpleNamespace(model="fitted"), none, none, none, none)  # type: ignore[arg-type]
    found = diagnosis_data(train=[reading([4.0, 0.0])], held_out=[reading([2.0, 2.0, 2.0])])
    assert [one[:2] for one in found.exclusive_channel_costs(fitted, ONE)] == [(4.0, 1.0), (3.0, 3.0)]
    assert [one[:2] for one in found.exclusive_channel_costs(fitted, TWO)] == [(0.0, 0.0)] * 2
    alone = replace(found, held_out=[]).exclusive_channel_costs(fitted, ONE)
    assert [one[:2] for one in alone] == [(4.0, 1.0), (0.0, 0.0)]


# --- the verdict


def rival(cost: float, gained: float) -> Candidate:
    before, after = model_fit([(cost + gained) / 2] * 2), model_fit([cost / 2] * 2)
    return Candidate(ONE, before, after, 0.0)


def test_chance_scales_with_the_remaining_variance() -> None:
    """1000 readings at ten times the noise: a parameter takes up a hundred times as much by chance."""
    best = replace(model_fit([5e4, 5e4]), residual_counts=np.full(2, 500.0))
    assert not_inferior(rival(1e5 + 300.0, 5e5).full, best)
    assert not not_inferior(rival(1e5 + 500.0, 5e5).full, best)


def estimate(value: float, error: float = 0.01, *, at_bound: bool = False, name: str = "friction.coulomb") -> Estimate:
    return Estimate(name, "N", value, error, (value - error, value + error), at_bound)


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        (estimate(10.0), estimate(12.1), True),
        (estimate(10.0), estimate(11.9), False),  # less than a fifth
        (estimate(10.0, 1.0), estimate(12.1, 1.0), False),  # within two standard errors of both
        (estimate(-10.0), estimate(-12.1), True),
        (estimate(10.0), estimate(10.0, at_bound=True), True),
    ],
)
def test_a_base_parameter_with_a_large_significant_shift_is_reported(
    before: Estimate, after: Estimate, told: bool
) -> None:
    one, other = (SimpleNamespace(estimates=(e, estimate(1.0, name="x"))) for e in (before, after))
    found = _parameter_shifts(one, other)  # type: ignore[arg-type]
    assert bool(found) == told
    if told:
        assert found == [Shift("friction.coulomb", before.value, after.value, "N", not after.at_bound)]
    assert _parameter_shifts(one, SimpleNamespace(estimates=())) == []  # type: ignore[arg-type]


# --- what would have shown


def size_of(name: str, *found: tuple[dict[str, float], float]) -> visible.MinimumDetectableEffect:
    signatures: Any = [
        SimpleNamespace(values={f"{name}.{k}": v for k, v in values.items()}, step_error=e, direct=False)
        for values, e in found
    ]
    known: Any = SimpleNamespace(model=model([name], {}))
    return visible._minimum_detectable_effect(catalogue()[name], signatures, known, visible.MDE_SIGMA)


def sentence(one: visible.MinimumDetectableEffect) -> str:
    """The sentence of the answer."""
    vessel: Any = SimpleNamespace(rig=SimpleNamespace(vessel_volume=1e-3))
    return detection_limit(one, vessel).would_show


def test_what_was_fitted_is_undetectable_beside_the_named_effects_only() -> None:
    """20 N is 1.7 typical sizes; its error beside the named effects is five of them, or as large as the fit's."""
    vessel: Any = SimpleNamespace(rig=SimpleNamespace(vessel_volume=1e-3))
    fitted = model(["constant-force"], {"constant-force.force": -20.0})
    unseen, seen = (size_of("constant-force", ({"force": 12.0}, error)) for error in (5.0, 0.4))
    beside = detection_limit(unseen, vessel, ["friction-asymmetry"], fitted)
    assert (beside.size, unseen.size) == (None, pytest.approx(240.0))
    assert beside.would_show.partition(": ")[2] == (
        "beside friction-asymmetry these recordings cannot detect it at any plausible size"
    )
    assert detection_limit(unseen, vessel, ["friction-asymmetry"]).would_show.partition(": ")[2] == (
        "these recordings cannot detect it at any plausible size"
    )
    assert detection_limit(replace(seen, plausible=False), vessel, [], fitted).size == pytest.approx(19.2)
    small = model(["constant-force"], {"constant-force.force": -19.0})
    assert detection_limit(replace(seen, plausible=False), vessel, [], small).size is None


def test_a_limit_is_per_volume_of_a_vessel_of_unknown_volume(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answer_parts, "only_ratio_identifiable", lambda study: study == "unknown")
    found = size_of("chamber-leak", ({"area": 1e-8}, 0.01))
    study: Any = "unknown"
    entry = detection_limit(found, study)
    assert (entry.size, entry.unit) == (pytest.approx(4 * 0.01 * 1e-8 / 1e-3), "m^2/m^3")  # a litre is assumed
    assert "m^2/m^3" in entry.would_show
    shift = parameter_shift(Shift("chamber-leak.area", 1e-8, 2e-8, "m^2", plausible=True), study)
    assert (shift.from_, shift.to, shift.unit) == (pytest.approx(1e-5), pytest.approx(2e-5), "m^2/m^3")
    friction = parameter_shift(Shift("friction.coulomb", 10.0, 14.0, "N", plausible=True), study)
    assert (friction.from_, friction.unit) == (10.0, "N")


def test_the_detection_limit_is_four_standard_errors_of_the_best_score_test() -> None:
    found = size_of("constant-force", ({"force": 20.0}, 0.5), ({"force": 10.0}, 0.05))
    assert (found.size, found.plausible, found.parameter.name) == (pytest.approx(4 * 0.05 * 10.0), True, "force")
    assert "above 2 N" in sentence(found)


def test_a_size_counts_from_the_null() -> None:
    found = size_of("pressure-scale", ({"scale": 1.1}, 0.25))
    assert found.size == pytest.approx(0.1)
    assert "from a difference of 0.1" in sentence(found)


def test_the_detection_limit_states_where_the_effect_acts() -> None:
    """A shorter cushion that the piston hardly reaches may be far stiffer."""
    long, short = {"length": 0.08, "damping": 100.0}, {"length": 0.03, "damping": 100.0}
    found = size_of("end-cushion", (short, np.inf), (long, 0.02))
    assert "above 8 N·s/m (damping at the very end; length of each cushion 80 mm)" in sentence(found)


@pytest.mark.parametrize(("error", "plausible"), [(0.74, True), (0.76, False)])
def test_a_limit_above_three_typical_sizes_is_implausible(error: float, plausible: bool) -> None:
    found = size_of("constant-force", ({"force": 10.0}, error))
    assert found.plausible == plausible
    assert ("cannot detect" in sentence(found)) != plausible


@pytest.mark.parametrize("signature", [None, ({"force": 10.0}, np.inf), ({"force": 10.0}, 0.0)])
def test_an_effect_without_a_finite_score_test_is_undetectable(signature: Any) -> None:
    found = size_of("constant-force", *([signature] if signature else []))
    assert (found.size, found.plausible) == (np.inf, False)


@pytest.mark.parametrize(("error", "plausible"), [(0.24, True), (0.26, False)])
def test_an_effect_without_a_null_shows_at_its_typical_size_or_not(error: float, plausible: bool) -> None:
    found = size_of("presliding", ({"stiffness": 2e4, "damping": 50.0}, error))
    assert (found.size, found.plausible) == (2e4, plausible)
    if plausible:
        assert "at 20000 N/m" in sentence(found)


def test_every_effect_that_the_model_lacks_and_can_show_has_a_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Static friction counts from the model's Coulomb friction of 14 N: 22 N are 8 N beyond, known to a tenth."""
    effects = {n: catalogue()[n] for n in ("constant-force", "stribeck", "extra-mass", "valve-lag")}
    values = {
        "stribeck": {"stribeck.static": 22.0, "stribeck.velocity": 0.01},
        "constant-force": {"constant-force.force": 10.0},
    }

    def found_for(effect: Any, fit: Any, residual_models: Any) -> list[Any]:
        known = values.get(effect.name)
        return [SimpleNamespace(values=known, step_error=0.1, gain=1.0, direct=False)] if known else []

    monkeypatch.setattr(data_module, "score_tests", found_for)
    ready = diagnosis_data(train=[seen("constant-force", "stribeck", "extra-mass")], effects=effects)
    fit: Any = SimpleNamespace(model=model(["extra-mass"]), covariance=np.eye(3))
    has = FittedModel(fit, *[np.zeros(0)] * 4)
    found = visible.minimum_detectable_effects(ready, has)
    assert [d.effect.name for d in found] == ["constant-force", "stribeck"]
    assert [d.size for d in found] == pytest.approx([4.0, 4 * 0.1 * 8.0])
    assert [d.parameter.name for d in found] == ["force", "static"]
    wide: Any = SimpleNamespace(covariance=9.0 * np.eye(3))  # with the variance that model error causes
    monkeypatch.setattr(data_module.DiagnosisData, "with_intervals", lambda self, fitted: wide)
    found = visible.minimum_detectable_effects(ready, has, complete=False)
    assert [d.size for d in found] == pytest.approx([12.0, 12 * 0.1 * 8.0])
