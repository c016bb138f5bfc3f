"""One round of the search: which effects are refitted, and what is decided on each."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from pneucli.diagnose import selection as rounds
from pneucli.diagnose.data import DiagnosisData, Refit, run_locally
from pneucli.diagnose.score import FittedModel
from tests.diagnose.synthetic_data import Facts, SyntheticData, alone, effect, synthetic_data


def signature(gain: float) -> Any:
    return SimpleNamespace(gain=gain)


def screened(**gains: float) -> set[str]:
    """The effects that are refitted, of those with such gains predicted, which act in every residual."""
    ranked = sorted(gains.items(), key=lambda one: -one[1])
    signatures = [(DATA.effects[n], [signature(g)]) for n, g in ranked]
    first, _ = rounds.score_test_screen(DATA, DATA.model_with([]), signatures)
    return {e.name for e, _ in first}


DATA = synthetic_data([effect(name) for name in "abcdefgh"], Facts(10.0, alone(a=0.3, b=0.28, c=0.2)))


def test_the_best_three_by_share_and_two_by_gain_are_refitted(monkeypatch: pytest.MonkeyPatch):
    """The gains of g and h are the largest, of residuals that cost so much that their shares are the smallest."""
    costs = dict.fromkeys("abcdef", 1e3) | dict.fromkeys("gh", 1e5)
    monkeypatch.setattr(SyntheticData, "sensitive_cost", lambda self, fitted, effect: (costs[effect.name], 100))
    assert screened(a=100.0, b=101.0, c=102.0, d=103.0, e=104.0, f=105.0, g=506.0, h=507.0) == set("defgh")


def test_what_leads_by_gain_as_well_takes_no_place_of_another():
    assert screened(a=100.0, b=101.0, c=102.0, d=103.0, e=104.0, f=105.0, g=106.0, h=107.0) == set("fgh")


@pytest.mark.parametrize(("gain", "refitted"), [(12.1, True), (11.9, False)])
def test_a_score_test_requires_a_chi_square_of_twelve(gain: float, refitted: bool):
    assert ("b" in screened(a=100.0, b=gain)) == refitted


@pytest.mark.parametrize(("gain", "refitted"), [(101.0, True), (99.0, False)])
def test_a_score_test_requires_one_percent_of_the_best(gain: float, refitted: bool):
    assert ("b" in screened(a=10_000.0, b=gain)) == refitted


def test_gains_are_relative_to_the_cost_of_the_residuals_that_the_effect_influences(monkeypatch: pytest.MonkeyPatch):
    """A tenth of little counts as much as a tenth of much that the effect does not act in."""
    costs = {"a": 1e6, "b": 1e3, "c": 1e3}
    monkeypatch.setattr(SyntheticData, "sensitive_cost", lambda self, fitted, effect: (costs[effect.name], 100))
    assert screened(a=1e5, b=100.0, c=13.0) == set("abc")
    assert screened(a=2e3, b=500.0) == {"b"}


def test_the_best_candidates_are_refitted_to_convergence_and_all_are_ranked_by_cost():
    """With a, b and c the costs are 8, 8.2 and 9 times that of noise: b is within 5 % of a."""
    converged: list[str] = []

    def recorded(data: DiagnosisData, refits: Sequence[Refit]) -> list[FittedModel]:
        converged.extend(r.effect.name for r in refits if r.kind == "converge")
        return run_locally(data, refits)

    data = replace(DATA, run_refits=recorded)
    decisions = rounds.screen_and_refit(data, data.model_with([]))
    assert [d.effect.name for d in decisions if d.candidate is not None] == ["a", "b", "c"]
    assert converged == ["a", "b"]


@pytest.mark.parametrize(("at_bound", "refitted"), [("abc", "abcdef"), ("ab", "abc")])
def test_where_none_of_the_best_passes_the_next_three_are_refitted(at_bound: str, refitted: str):
    predicted = {name: 0.9 - 0.1 * i for i, name in enumerate("abcdefgh")}
    facts = Facts(10.0, alone(a=0.1, b=0.1, c=0.1, e=0.6), predicted=predicted, at_bound=frozenset(at_bound))
    data = synthetic_data([effect(name) for name in "abcdefgh"], facts)
    decisions = rounds.screen_and_refit(data, data.model_with([]))
    assert {d.effect.name for d in decisions if d.candidate is not None} == set(refitted)
    assert [d.effect.name for d in decisions if d.supported] == (["e"] if "c" in at_bound else ["c"])
