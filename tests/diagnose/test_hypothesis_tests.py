"""Every test that a candidate may fail gives its own reason, and where it ended comes before chance."""

from typing import Any

import pytest

from pneucli.diagnose import constraints
from pneucli.diagnose.candidate import Reason, supported_candidates
from pneucli.diagnose.selection import apply_tests
from tests.diagnose.candidates import candidate, diagnosis_data

INSIDE = {"asymmetry": (0.2, False), "viscous_asymmetry": (0.1, False)}


def reason(effect: str, **stated: Any) -> Reason:
    """The reason why a candidate passes or fails, one of 50 hypotheses."""
    (decision,) = apply_tests(diagnosis_data(), [candidate(effect, **stated)])
    return decision.reason


def test_a_candidate_that_passes_all_tests_is_supported():
    assert reason("friction-asymmetry", ends=INSIDE) == "supported"


@pytest.mark.parametrize(("cost", "said"), [(7999.0, "supported"), (8001.0, "not-significant")])
def test_a_candidate_must_lower_the_cost_however_far_its_parameters_are_from_their_nulls(cost: float, said: str):
    assert reason("friction-asymmetry", ends=INSIDE, cost=cost) == said


@pytest.mark.parametrize(
    ("effect", "ends", "p_value", "said"),
    [
        ("chamber-leak", {"area": (0.0, True)}, 0.5, "vanishes"),
        # the null of their stiffness is infinite: the bound on the way there is as good as absent
        ("presliding", {"stiffness": (1e8, True), "damping": (80.0, False)}, 0.5, "vanishes"),
        ("friction-hysteresis", {"drop": (0.95, True)}, 1e-12, "at-bound"),
        ("friction-hysteresis", {"drop": (0.95, True)}, 0.7, "at-bound"),
        # bristles without damping are bristles; they are none where chance explains them as well
        ("presliding", {"stiffness": (2e4, False), "damping": (0.0, True)}, 0.7, "at-bound"),
        ("presliding", {"stiffness": (2e4, False), "damping": (0.0, True)}, 1e-9, "supported"),
    ],
)
def test_the_end_of_a_fit_decides_before_its_p_value(
    effect: str, ends: dict[str, tuple[float, bool]], p_value: float, said: str
):
    assert reason(effect, ends=ends, p_value=p_value) == said


@pytest.mark.parametrize(("drop", "said"), [((0.95, True), "at-bound"), ((0.0, True), "supported")])
def test_an_effect_that_nothing_makes_absent_may_end_where_it_would_be_absent_alone_and_at_no_other_bound(
    drop: tuple[float, bool], said: str
):
    """Without a drop the Stribeck rise still holds while speeding up alone; with 0.95 no friction is left."""
    found = candidate("friction-hysteresis", ends={"drop": drop}, beside=["stribeck"])
    (decision,) = apply_tests(diagnosis_data(), [found])
    assert decision.reason == said


@pytest.mark.parametrize(("delay", "said"), [(0.4e-3, "below-resolution"), (0.6e-3, "supported")])
def test_a_time_shorter_than_half_a_sample_is_below_the_resolution(delay: float, said: str):
    assert reason("line-delay", ends={"delay": (delay, False)}) == said


def test_a_refuted_fault_does_not_exclude_its_equivalent(monkeypatch: pytest.MonkeyPatch):
    """A force that looks like an offset of a pressure: were the offset refused only at the end, none was named."""
    monkeypatch.setattr(
        constraints, "refuted_by_reading", lambda model, effect, residual_models: effect.name == "pressure-offset"
    )
    assert reason("pressure-offset", ends={"offset": (16e3, False)}) == "contradicted-by-reading"
    assert reason("constant-force", ends={"force": (17.0, False)}) == "supported"


@pytest.mark.parametrize(("p_value", "said"), [(3.9e-4, "supported"), (4.1e-4, "not-significant")])
def test_chance_is_that_of_the_whole_family(p_value: float, said: str):
    """50 hypotheses and 0.02: a single one must be below 4e-4."""
    assert reason("friction-asymmetry", ends=INSIDE, p_value=p_value) == said


def test_an_undefined_p_value_is_not_significant():
    assert reason("friction-asymmetry", ends=INSIDE, p_value=float("nan")) == "not-significant"


def test_however_small_a_reduction_is_a_significant_candidate_is_supported():
    """What is too little to be probable is judged with all effects in the model."""
    assert reason("friction-asymmetry", cost=7999.0, ends=INSIDE) == "supported"


def test_the_second_smallest_p_value_counts_against_one_hypothesis_less():
    """Of 50 hypotheses the smallest p value counts 50 times, the next one 49 times: below 0.02 / 49 = 4.08e-4."""
    first = candidate("extra-mass", p_value=1e-9)
    for p_value, said in ((4.07e-4, "supported"), (4.09e-4, "not-significant")):
        second = candidate("friction-asymmetry", ends=INSIDE, p_value=p_value)
        assert [d.reason for d in apply_tests(diagnosis_data(), [second, first])] == [said, "supported"]


def test_more_candidates_than_hypotheses_are_a_family_by_themselves():
    """A round may refit more effects than the catalogue has hypotheses left."""
    data = diagnosis_data()
    data.__dict__["hypothesis_count"] = 1
    pair = [candidate(name, p_value=0.015) for name in ("extra-mass", "constant-force")]
    assert [d.reason for d in apply_tests(data, pair)] == ["not-significant", "not-significant"]
    assert [d.reason for d in apply_tests(data, pair[:1])] == ["supported"]


def test_supported_candidates_are_those_of_the_decisions_with_that_reason():
    good, bad = candidate("friction-asymmetry", ends=INSIDE), candidate("extra-mass", p_value=0.3)
    assert supported_candidates(apply_tests(diagnosis_data(), [bad, good])) == [good]
