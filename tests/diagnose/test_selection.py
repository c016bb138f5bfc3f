"""Every step of the selection, on effects whose share of the remainder is stated."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import evidence, hypothesis_tests, next_term, selection
from pneucli.diagnose.adequacy import LackOfFit
from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.evidence import ScoreGain
from pneucli.diagnose.score import FittedModel
from pneucli.diagnose.selection import SelectionPath, screen_and_refit, select_effects
from pneucli.identify.residuals import ForceBalance
from tests.diagnose.synthetic_data import SyntheticData, adding, effect


@pytest.fixture(autouse=True)
def sure(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """How likely each effect is beside something unknown; 0.9 unless stated."""
    known: dict[str, float] = {}
    for module in (selection, next_term):
        monkeypatch.setattr(
            module, "posterior_probability", lambda diagnosis_data, place: known.get(place.candidate.effect.name, 0.9)
        )
    monkeypatch.setattr(
        next_term, "log_odds_among_equivalents", lambda diagnosis_data, candidate: known.get(candidate.effect.name, 0.9)
    )
    return known


@pytest.fixture(autouse=True)
def remainder(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is left of a state is its cost over its samples."""

    def left(diagnosis_data: Any, model_fit: FittedModel) -> tuple[list[LackOfFit], list[LackOfFit]]:
        ratio = float(np.sqrt(model_fit.cost / model_fit.residual_count))
        return [LackOfFit(ForceBalance, "force", ratio, ratio, ())], []

    for module in (selection, next_term, hypothesis_tests):
        monkeypatch.setattr(module, "lack_of_fit", left)
    monkeypatch.setattr(evidence, "RESAMPLES", 200)  # falls are far from chance or far from certain


def found(diagnosis_data: SyntheticData, *base: str) -> SelectionPath:
    return select_effects(diagnosis_data, diagnosis_data.model_with(base))  # type: ignore[arg-type]


def names(result: SelectionPath) -> set[str]:
    return set(result.added)


A, B, C, D, E = (effect(name) for name in "abcde")


def test_a_single_sufficient_effect_is_selected() -> None:
    result = found(SyntheticData([A, B, C], adding(a=1.0)))
    assert result.added == ["a"]
    assert result.adequate
    assert [s.effect_names for s in result.models] == [[], ["a"]]
    assert result.last.effect_names == ["a"]


def test_candidates_of_the_base_model_are_fitted_once() -> None:
    synthetic = SyntheticData([A, B, C], adding(a=1.0))
    found(synthetic)
    assert sorted(synthetic.added_names) == [("a",), ("a", "b"), ("a", "c")]


def test_with_a_white_residual_no_effect_is_selected() -> None:
    result = found(SyntheticData([A, B, C], adding(), excess=0.0))
    assert result.added == []
    assert result.adequate
    assert len(result.models) == 1


def test_two_effects_are_selected_the_larger_one_first() -> None:
    result = found(SyntheticData([A, B, C], adding(a=0.3, b=0.7)))
    assert result.added == ["b", "a"]
    assert result.adequate


def test_effects_of_the_given_model_are_not_selected() -> None:
    result = found(SyntheticData([A, B, C], adding(a=0.5, b=0.5)), "a")
    assert result.added == ["b"]
    assert [s.effect_names for s in result.models] == [["a"], ["a", "b"]]


def test_an_unexplained_residual_makes_the_path_inadequate() -> None:
    result = found(SyntheticData([A, B, C], adding(a=0.3)))
    assert result.added == ["a"]
    assert not result.adequate


def test_an_overfitted_effect_is_not_selected() -> None:
    assert found(SyntheticData([A, B], adding(a=0.5), unseen=adding(a=-0.02), excess=0.5)).added == []


def test_without_held_out_data_the_fitted_gain_decides() -> None:
    assert found(SyntheticData([A, B], adding(a=0.5), unseen=adding(), excess=0.5, held_out=False)).added == ["a"]


def test_an_effect_that_raises_the_free_run_error_is_not_selected() -> None:
    assert found(SyntheticData([A, B], adding(a=1.0), worse={"a"})).added == []


def test_at_most_four_effects_are_selected() -> None:
    six = [effect(n) for n in "abcdef"]
    assert len(found(SyntheticData(six, adding(**dict.fromkeys("abcdef", 0.3)), excess=2.0)).added) == 4


def test_an_effect_that_resembles_two_others_is_dropped_with_both() -> None:
    def takes(chosen: frozenset[str]) -> float:
        pair = 0.5 * len(chosen & {"b", "c"})
        return max(pair, 0.6 + 0.3 * pair) if "a" in chosen else pair

    assert names(found(SyntheticData([A, B, C], takes))) == {"b", "c"}


def test_an_effect_without_an_initial_guess_follows_the_one_that_gives_it() -> None:
    """As Stribeck's, which is counted in dry friction, where the base has none before a load takes its part."""

    def takes(chosen: frozenset[str]) -> float:
        pair = 0.7 * ("b" in chosen) + 0.3 * ("c" in chosen)
        return max(pair, 0.75 + 0.2 * pair) if "a" in chosen else pair

    result = found(SyntheticData([A, B, C], takes, sized_by={"b": {"c"}}))
    assert result.added == ["c", "b"]
    circle = found(SyntheticData([A, B, C], takes, sized_by={"b": {"c"}, "c": {"a"}}))
    assert circle.added[0] == "a"


def test_with_an_unmodelled_effect_the_most_probable_candidate_is_first(sure: dict[str, float]) -> None:
    """Not where the user would see the error rise by it, nor where the other leaves nothing."""

    def takes(chosen: frozenset[str]) -> float:
        return max({"a": 0.605, "b": 0.6}.get(n, 0.0) for n in {*chosen, "c"})

    assert found(SyntheticData([A, B, C], takes, excess=2.0)).added == ["a"]
    sure["b"] = 0.95
    assert found(SyntheticData([A, B, C], takes, excess=2.0)).added == ["b"]
    assert found(SyntheticData([A, B, C], takes, worse={"b"}, excess=2.0)).added == ["a"]
    assert found(
        SyntheticData([A, B, C], lambda chosen: max(takes(chosen), 2.0 * ("a" in chosen)), excess=2.0)
    ).added == ["a"]


def test_with_an_unmodelled_effect_an_improbable_effect_is_dropped(sure: dict[str, float]) -> None:
    """The least likely first; what is there alone stays, and all that leave nothing together."""
    sure.update(b=0.4, c=0.3)
    result = found(SyntheticData([A, B, C], adding(a=0.4, b=0.2, c=0.2), excess=2.0))
    assert result.added == ["a"]
    assert [t.effect.name for t in result.improbable] == ["c", "b"]
    assert {d.effect.name: d.reason for d in result.decisions} == dict.fromkeys("bc", "explained-by-unknown")
    assert found(SyntheticData([B, C], adding(b=0.4), excess=2.0)).added == ["b"]
    assert names(found(SyntheticData([A, B, C], adding(a=0.8, b=0.6, c=0.6), excess=2.0))) == {"a", "b", "c"}


def test_an_improbable_effect_is_dropped_before_a_needless_one(sure: dict[str, float]) -> None:
    """A weak spring far from its rest takes the place of an asymmetry, and something unknown besides."""
    sure["b"] = 0.1

    def takes(chosen: frozenset[str]) -> float:
        return 0.62 if {"a", "b"} <= chosen else 0.619 if "b" in chosen else 0.6 * ("a" in chosen)

    diagnosis_data = SyntheticData([A, B], takes, excess=2.0)
    kept, refused, _ = selection._without_needless(
        diagnosis_data, diagnosis_data.model_with(()), diagnosis_data.model_with(("a", "b"))
    )  # type: ignore[arg-type]
    assert kept.effect_names == ["a"]
    assert [(d.effect.name, d.reason) for d in refused] == [("b", "explained-by-unknown")]


def test_with_an_unmodelled_effect_a_pair_must_be_probable(sure: dict[str, float]) -> None:
    def takes(chosen: frozenset[str]) -> float:
        return 0.7 if {"a", "b"} <= chosen else 0.002 * len(chosen & {"a", "b"})

    assert names(found(SyntheticData([A, B], takes, excess=2.0))) == {"a", "b"}
    sure["a"] = 0.4
    assert names(found(SyntheticData([A, B], takes, excess=2.0))) == set()


def test_dropping_an_effect_restores_those_that_it_made_needless() -> None:
    """Beside b, which explains more and raises the error that the user sees, a has nothing left to explain."""

    def takes(chosen: frozenset[str]) -> float:
        return 0.9 if {"a", "b"} <= chosen else 0.89 if "b" in chosen else 0.5 * ("a" in chosen)

    way = [["a"], ["a", "b"]]
    diagnosis_data = SyntheticData([A, B], takes, worse={"b"})
    rungs = [diagnosis_data.model_with(()), *(diagnosis_data.model_with(names) for names in way)]
    kept, _, refused = selection._revise(diagnosis_data, rungs, [[]])  # type: ignore[arg-type]
    assert kept[-1].effect_names == ["a"]
    assert [(d.effect.name, d.reason) for d in refused] == [("b", "raises-error")]


@pytest.mark.parametrize(("share", "found_names"), [(1.0, {"a"}), (0.5, {"a:1", "a:2"})])
def test_an_effect_of_both_chambers_replaces_the_same_effect_at_each(share: float, found_names: set[str]) -> None:
    """Two equal hoses are one delay; where one delay for both explains half as much, they are two."""
    sides = [effect("a:1", side=1), effect("a:2", side=2)]

    def takes(chosen: frozenset[str]) -> float:
        return max(0.5 * len(chosen & {"a:1", "a:2"}), share * ("a" in chosen))

    data = SyntheticData([effect("a"), *sides], takes)
    kept, _ = selection._with_whole_effects(data, data.model_with(()), data.model_with(("a:1", "a:2")), {})  # type: ignore[arg-type]
    assert set(kept.effect_names) == found_names


def test_equivalents_of_an_effect_are_its_rivals() -> None:
    def takes(chosen: frozenset[str]) -> float:
        return 1.0 if chosen & {"a", "b"} else 0.0

    result = found(SyntheticData([A, B, C], takes))
    (name,) = result.added
    assert {t.effect.name for t in result.terms[name].rivals} == {"a", "b"} - {name}


def test_a_pair_without_a_supported_single_effect_is_selected() -> None:
    result = found(SyntheticData([A, B, C], lambda chosen: 1.0 if {"a", "b"} <= chosen else 0.0))
    assert names(result) == {"a", "b"}
    assert result.adequate


def test_the_second_of_a_pair_has_the_best_score_given_the_first() -> None:
    """Beside the base b promises nothing, c and d much; beside a, which held-out data refuse, it leaves nothing."""

    def takes(chosen: frozenset[str]) -> float:
        single = max((0.3, "a" in chosen), (0.2, "c" in chosen), (0.1, "d" in chosen), key=lambda one: one[0] * one[1])
        return 1.0 if {"a", "b"} <= chosen else single[0] * single[1]

    synthetic = SyntheticData([A, B, C, D], takes, unseen=lambda chosen: 1.0 if {"a", "b"} <= chosen else 0.0)
    assert names(found(synthetic)) == {"a", "b"}
    assert ("c", "d") not in synthetic.added_names


def test_a_pair_is_fitted_in_one_order_only() -> None:
    """b and c raise the error of the free run; beside each a promises most, and both were fitted beside a."""
    synthetic = SyntheticData([A, B, C], adding(a=0.5, b=0.06, c=0.05), worse={"b", "c"})
    assert found(synthetic).added == ["a"]
    fitted = [frozenset(one) for one in synthetic.added_names]
    assert len(fitted) == len(set(fitted))


def test_the_revised_path_starts_with_the_largest_reduction() -> None:
    def takes(chosen: frozenset[str]) -> float:
        pair = 0.3 * ("b" in chosen) + 0.7 * ("c" in chosen)
        return max(pair, 0.75 + 0.2 * pair) if "a" in chosen else pair

    assert found(SyntheticData([A, B, C], takes)).added == ["c", "b"]


# --- what is tried


CERTAIN = ScoreGain(400.0, 300.0, 1e-9, 30.0)


def costing(cost: float) -> FittedModel:
    fit: Any = SimpleNamespace(estimates=[], free=(), model=SimpleNamespace(values={}, effects=()))
    return FittedModel(fit, np.full(40, cost / 40.0), np.zeros(0), np.full(40, cost / 40.0), np.full(40, 250.0))


BEFORE = costing(10000.0)


class Screened(SyntheticData):
    """Signatures promise what is stated; fits cost what is stated."""

    def __init__(self, promised: dict[str, float], costs: dict[str, float] | None = None) -> None:
        super().__init__([effect(n) for n in promised], adding())
        self.promised, self.costs = promised, costs or {}

    def ranked_signatures(self, model_fit: FittedModel) -> list[Any]:
        ranked = sorted(self.promised.items(), key=lambda pair: -pair[1])
        return [(self.effects[n], [SimpleNamespace(gain=g)]) for n, g in ranked]

    def refit_with(self, model_fit: FittedModel, effects: Sequence[Any], ranked: Any = ()) -> list[Candidate]:
        costs = [self.costs.get(one.name, 9000.0) for one in effects]
        gains = [ScoreGain(10000.0 - cost, 1.0, 1e-9, 30.0) for cost in costs]
        return [
            Candidate(e, BEFORE, costing(c), g, CERTAIN, 1e-9) for e, c, g in zip(effects, costs, gains, strict=True)
        ]


def order(diagnosis_data: Screened, without: tuple[str, ...] = ()) -> list[str]:
    """The effects that were fitted."""
    return [d.effect.name for d in screen_and_refit(diagnosis_data, BEFORE, without) if d.candidate is not None]  # type: ignore[arg-type]


def test_at_most_six_effects_are_refitted() -> None:
    assert set(order(Screened({n: 100.0 + k for k, n in enumerate("abcdefgh")}))) == set("hgfedc")


@pytest.mark.parametrize(("promise", "refitted"), [(12.1, True), (11.9, False)])
def test_a_score_test_requires_a_chi_square_of_twelve(promise: float, refitted: bool) -> None:
    assert ("b" in order(Screened({"a": 100.0, "b": promise}))) == refitted


def test_a_score_test_requires_one_percent_of_the_best() -> None:
    assert order(Screened({"a": 10000.0, "b": 99.0})) == ["a"]
    assert set(order(Screened({"a": 10000.0, "b": 101.0}))) == {"a", "b"}


def test_scores_are_relative_to_the_sensitive_cost() -> None:
    """A tenth of little counts as much as a tenth of much that it does not act in."""

    class Apart(Screened):
        def sensitive_cost(self, model_fit: FittedModel, one: Any) -> tuple[float, int]:
            return (1e6, 100) if one.name == "a" else (1e3, 100)

    assert set(order(Apart({"a": 1e5, "b": 100.0, "c": 13.0}))) == {"a", "b", "c"}
    assert order(Apart({"a": 2e3, "b": 500.0})) == ["b"]


def test_an_excluded_effect_is_not_the_reference() -> None:
    assert order(Screened({"a": 10000.0, "b": 99.0}), ("a",)) == ["b"]
    assert order(Screened({"a": 10000.0}), ("a",)) == []


def test_candidates_are_sorted_by_cost_and_only_the_best_converge() -> None:
    diagnosis_data = Screened({"a": 50.0, "b": 60.0, "c": 70.0}, {"a": 8000.0, "b": 8500.0, "c": 8300.0})
    assert order(diagnosis_data) == ["a", "c", "b"]
    assert set(diagnosis_data.polished_names) == {"a", "c"}  # within 5 %
    slight = Screened({"a": 50.0}, {"a": 9970.0})
    order(slight)
    assert slight.polished_names == []  # 0.3 % of the cost


def test_a_path_knows_its_added_effects() -> None:
    synthetic = SyntheticData([A, B, C], adding())
    rungs = tuple(synthetic.model_with(n) for n in (["a"], ["a", "b"], ["a", "b", "c"]))
    result = SelectionPath(rungs, (), {}, (), ())
    assert result.added == ["b", "c"]
    assert result.adequate
