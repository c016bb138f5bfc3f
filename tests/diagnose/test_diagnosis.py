"""The diagnosis as a whole: its verdict, the named effects and their equivalents, probabilities, and what is left."""

import math
from dataclasses import replace
from typing import Any

import pytest

from pneucli.diagnose.calibration import WEIGHTS_DISCREPANCY, presence_rate, probability
from pneucli.diagnose.diagnosis import Diagnosis, diagnose
from pneucli.diagnose.score import FittedModel
from pneucli.messages.compare import LackOfFit, WorstChannel
from tests.diagnose.selection_cases import data_of, named
from tests.diagnose.synthetic_data import Facts, SyntheticData, alone, effect, synthetic_data

A, B, C = (effect(name) for name in "abc")


def diagnosed(data: SyntheticData) -> Diagnosis:
    """The diagnosis of the model without effects."""
    return diagnose(data, data.model_with([]).fit)


def stated(excess: float, together: dict[str, float] | None = None, **explains: float) -> SyntheticData:
    """The data with the effects a, b and c; by default they explain nothing."""
    sets = {frozenset(names): share for names, share in (together or {}).items()}
    return synthetic_data([A, B, C], Facts(excess, alone(**explains) | sets))


def reasons(found: Diagnosis) -> dict[str, str]:
    return {d.effect.name: d.reason for d in found.decisions}


# --- the verdict


def test_where_the_added_effects_leave_only_noise_they_are_missing() -> None:
    found = diagnosed(stated(10.0, a=0.7, b=0.3))
    assert (found.verdict, found.missing, found.unexplained) == ("missing-effect", ("a", "b"), None)
    assert reasons(found) == {"a": "supported", "b": "supported", "c": "not-promising"}
    assert found.equivalents == {"a": (), "b": ()}


def test_effects_are_named_beside_what_no_effect_explains() -> None:
    """The channel of the last model is described: of a variance of 11 there remain 3."""
    found = diagnosed(stated(10.0, a=0.8))
    assert (found.verdict, found.missing) == ("unexplained", ("a",))
    assert found.unexplained is not None
    assert (found.unexplained.channel, found.unexplained.ratio) == ("force", pytest.approx(3.0**0.5))


def judged_as(data: SyntheticData, **judged: Any) -> SyntheticData:
    """The data with a judgement of the printed error of every model."""
    worst = WorstChannel("one", "x", 3.0)
    usual = LackOfFit(
        present=False, p=1.0, undetermined=False, use="test", error=1.0, limit=1.2, excused=0, worst=worst
    )
    return replace(data, judge_fit=lambda fitted: replace(usual, **judged))


def test_a_printed_error_beyond_noise_is_unexplained_however_well_each_subsystem_fits() -> None:
    found = diagnosed(judged_as(stated(10.0, a=1.0), present=True))
    assert (found.verdict, found.missing) == ("unexplained", ("a",))
    assert found.lack_of_fit is not None
    assert found.lack_of_fit.balance is None
    assert found.unexplained is not None
    assert (found.unexplained.channel, found.unexplained.ratio) == ("x", 3.0)
    assert diagnosed(judged_as(stated(0.0), present=True)).verdict == "unexplained"


def test_a_large_error_that_uncertain_parameters_explain_is_no_adequate_model() -> None:
    assert diagnosed(judged_as(stated(0.0))).verdict == "adequate"
    assert diagnosed(judged_as(stated(0.0), undetermined=True)).verdict == "inconclusive"
    assert diagnosed(judged_as(stated(10.0, a=1.0), undetermined=True)).verdict == "missing-effect"


def test_a_subsystem_that_errs_is_named_beside_the_judgement() -> None:
    found = diagnosed(judged_as(stated(10.0, a=0.8)))
    assert found.verdict == "unexplained"
    assert found.lack_of_fit is not None
    assert found.lack_of_fit.present
    assert found.lack_of_fit.balance is not None
    assert found.lack_of_fit.balance.channel == "force"


def test_without_a_named_effect_the_given_model_is_described() -> None:
    found = diagnosed(stated(10.0, a=0.35))
    assert (found.verdict, found.missing, reasons(found)["a"]) == ("unexplained", (), "explained-by-unknown")
    assert found.unexplained is not None
    assert found.unexplained.ratio == pytest.approx(11.0**0.5)
    assert found.path.last.effect_names == []


def test_a_model_that_leaves_only_noise_is_adequate() -> None:
    found = diagnosed(stated(0.0))
    assert (found.verdict, found.missing, found.unexplained) == ("adequate", (), None)
    assert dict(found.equivalents) == {}


@pytest.mark.parametrize(("undetectable", "verdict"), [("a", "adequate"), ("ab", "inconclusive")])
def test_a_model_is_not_adequate_where_most_effects_would_not_have_shown(undetectable: str, verdict: str) -> None:
    """One or two of three: their sizes have standard errors of half the typical size, of which four are needed."""

    class Blurred(SyntheticData):
        def signatures_of(self, fitted: FittedModel, effects: Any) -> list[Any]:
            found = super().signatures_of(fitted, effects)
            for one, (test,) in found:
                test.step_error = 0.5 if one.name in undetectable else 0.1  # type: ignore[misc]
            return found

    sharp = stated(0.0)
    blurred = Blurred(sharp.train, [], sharp.effects, free_run_errors=sharp.free_run_errors, facts=sharp.facts)
    found = diagnosed(blurred)
    assert (found.verdict, found.unexplained) == (verdict, None)
    assert {d.effect.name for d in found.detectable if not d.typical} == set(undetectable)
    lacking = replace(blurred, facts=Facts(10.0, alone(c=1.0)))
    assert diagnosed(lacking).verdict == "missing-effect"  # what is found does not depend on what is not


@pytest.mark.parametrize("excess", [0.0, 10.0])
def test_in_recordings_that_cannot_be_true_nothing_is_looked_for(excess: float) -> None:
    """Whatever a search would have found, and however large the residual is."""
    found = diagnosed(replace(stated(excess, a=1.0), implausible=True))
    assert (found.verdict, found.missing, found.unexplained) == ("inconclusive", (), None)
    assert reasons(found) == {}


# --- intervals


def beside_a_small_effect(interval: float) -> SyntheticData:
    """The data of a, beside which b may be there in small; ``interval`` is the factor on the interval of a."""
    explained = {frozenset("a"): 0.8, frozenset("b"): 0.5, frozenset("ab"): 0.85}
    return synthetic_data([A, B], Facts(10.0, explained, size={"b": 0.05}, interval={"a": interval}))


def test_the_interval_of_a_named_effect_contains_that_beside_an_effect_that_may_be_there_in_small() -> None:
    data = beside_a_small_effect(3.0)
    found = diagnosed(data)
    assert found.missing == ("a",)
    assert reasons(found)["b"] == "explained-by-unknown"
    (alone_low, _), (low, _) = (fit.estimates[0].ci95 for fit in (data.with_intervals(found.path.last), found.fit))
    assert low == data.with_intervals(data.model_with(["a", "b"])).estimates[0].ci95[0] < alone_low


def test_a_model_in_which_a_named_effect_may_be_absent_widens_no_interval() -> None:
    data = beside_a_small_effect(61.0)
    found = diagnosed(data)
    assert found.missing == ("a",)
    low, high = data.with_intervals(data.model_with(["a", "b"])).estimates[0].ci95
    assert low < 0.0 < high
    assert found.fit.estimates == data.with_intervals(found.path.last).estimates


# --- decisions, equivalents and probabilities


def test_an_equivalent_is_told_beside_the_named_effect() -> None:
    found = diagnosed(stated(10.0, {"ab": 1.0}, a=1.0, b=1.0))
    assert found.equivalents == {"a": ("b",)}
    assert reasons(found) == {"a": "supported", "b": "supported", "c": "not-promising"}


def test_an_equivalent_that_violates_a_constraint_is_not_told() -> None:
    data = stated(10.0, {"ab": 1.0}, a=1.0, b=1.0)
    found = diagnosed(replace(data, facts=replace(data.facts, interval={"b": 1000.0})))
    assert found.equivalents == {"a": ()}
    assert reasons(found)["b"] == "needless"


def test_equivalents_share_the_probability_that_one_of_them_is_there() -> None:
    found = diagnosed(stated(10.0, {"ab": 1.0}, a=1.0, b=1.0))
    sure = probability(found.evidence["a"])
    assert sure > 0.9
    assert found.confidence["a"] == (sure, pytest.approx(0.5 * sure))
    assert found.confidence["b"] == (sure, pytest.approx(0.5 * sure))


def test_beside_an_unmodelled_effect_equivalents_share_by_their_log_odds() -> None:
    """b leaves more of the variance, and its free run errs more: ten readings of the logarithm of that error."""
    data = stated(10.0, {"ab": 0.9}, a=0.9, b=0.88)
    found = diagnosed(data)
    assert found.equivalents == {"a": ("b",)}
    of_set, first = found.confidence["a"]
    assert of_set == probability(found.evidence["a"])
    assert found.confidence["b"].of_set == of_set
    second = found.confidence["b"].alone
    assert first + second == pytest.approx(of_set)
    by_errors = (2.2 / 2.0) ** (10.0 / 2.0)  # of the variances that remain
    by_evidence = (2.0 / 2.2) ** (WEIGHTS_DISCREPANCY[-1] / math.log(10.0))  # the odds by the remaining variance
    assert first / second == pytest.approx(by_errors * by_evidence, rel=1e-3)


def test_a_dropped_effect_keeps_the_probability_by_its_evidence() -> None:
    found = diagnosed(data_of(named("improbable effects are dropped, the least probable first")))
    assert found.missing == ("a",)
    for name in "bc":
        p = probability(found.evidence[name])
        assert found.confidence[name] == (p, p)
        assert p < 0.5
    assert found.confidence["c"].of_set < found.confidence["b"].of_set


def test_an_effect_that_a_reason_speaks_against_is_as_probable_as_on_exams() -> None:
    """Whatever its evidence would make it."""
    case = named("an effect that raises the free-run error is dropped however probable it is")
    found = diagnosed(data_of(case))
    assert probability(found.evidence["a"]) > 0.5
    rate = presence_rate("raises-error")
    assert found.confidence["a"] == (rate, rate)
    assert found.confidence["b"] == (presence_rate("not-promising"),) * 2


def test_every_effect_of_the_catalogue_has_one_decision_and_a_probability() -> None:
    for excess in (0.0, 0.4, 10.0):
        found = diagnosed(stated(excess, {"ab": 0.9}, a=0.8, b=0.3))
        assert sorted(reasons(found)) == sorted(found.confidence) == ["a", "b", "c"]
        assert all(0.0 < one.alone <= one.of_set < 1.0 for one in found.confidence.values())
