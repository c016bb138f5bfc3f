"""Every test that a candidate may fail gives its own reason, and where it ended comes before chance."""

from typing import Any

import pytest

from pneucli.diagnose import constraints, selection
from pneucli.diagnose.candidate import Reason, supported_candidates
from pneucli.diagnose.selection import apply_tests
from tests.diagnose.candidates import candidate, diagnosis_data

INSIDE = {"asymmetry": (0.2, False), "viscous_asymmetry": (0.1, False)}


@pytest.fixture(autouse=True)
def noise_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The model that the candidates extend leaves only noise."""
    monkeypatch.setattr(selection, "is_complete", lambda data, fitted: True)


def reason(effect: str, **stated: Any) -> Reason:
    """The reason why a candidate passes or fails, one of 50 hypotheses."""
    (decision,) = apply_tests(diagnosis_data(), [candidate(effect, **stated)])
    return decision.reason


@pytest.mark.parametrize(
    ("effect", "changed", "said"),
    [
        ("friction-asymmetry", {}, "supported"),
        # it must lower the cost, however little and however far its parameters are from their nulls
        ("friction-asymmetry", {"cost": 7999.0}, "supported"),
        ("friction-asymmetry", {"cost": 8001.0}, "not-significant"),
        # of 50 hypotheses a single one must be below 0.02 / 50
        ("friction-asymmetry", {"p_value": 3.9e-4}, "supported"),
        ("friction-asymmetry", {"p_value": 4.1e-4}, "not-significant"),
        ("friction-asymmetry", {"p_value": float("nan")}, "not-significant"),
        # the end of a fit decides before its p value
        ("chamber-leak", {"ends": {"area": (0.0, True)}, "p_value": 0.5}, "vanishes"),
        # the null of their stiffness is infinite: the bound on the way there is as good as absent
        ("presliding", {"ends": {"stiffness": (1e8, True), "damping": (80.0, False)}, "p_value": 0.5}, "vanishes"),
        ("friction-hysteresis", {"ends": {"drop": (0.95, True)}, "p_value": 1e-12}, "at-bound"),
        ("friction-hysteresis", {"ends": {"drop": (0.95, True)}, "p_value": 0.7}, "at-bound"),
        # bristles without damping are bristles; they are none where chance explains them as well
        ("presliding", {"ends": {"stiffness": (2e4, False), "damping": (0.0, True)}, "p_value": 0.7}, "at-bound"),
        ("presliding", {"ends": {"stiffness": (2e4, False), "damping": (0.0, True)}, "p_value": 1e-9}, "supported"),
        # a time shorter than half a sample
        ("line-delay", {"ends": {"delay": (0.4e-3, False)}}, "below-resolution"),
        ("line-delay", {"ends": {"delay": (0.6e-3, False)}}, "supported"),
    ],
)
def test_a_candidate_has_the_reason_of_the_first_test_that_it_fails(effect: str, changed: dict[str, Any], said: str):
    assert reason(effect, **({"ends": INSIDE} if effect == "friction-asymmetry" else {}) | changed) == said


@pytest.mark.parametrize(("drop", "said"), [((0.95, True), "at-bound"), ((0.0, True), "supported")])
def test_an_effect_that_nothing_makes_absent_may_end_where_it_would_be_absent_alone_and_at_no_other_bound(
    drop: tuple[float, bool], said: str
):
    """Without a drop the Stribeck rise still holds while speeding up alone; with 0.95 no friction is left."""
    found = candidate("friction-hysteresis", ends={"drop": drop}, beside=["stribeck"])
    (decision,) = apply_tests(diagnosis_data(), [found])
    assert decision.reason == said


def test_a_refuted_fault_does_not_exclude_its_equivalent(monkeypatch: pytest.MonkeyPatch):
    """A force that looks like an offset of a pressure: were the offset refused only at the end, none was named."""
    monkeypatch.setattr(
        constraints, "refuted_by_reading", lambda model, effect, residual_models: effect.name == "pressure-offset"
    )
    assert reason("pressure-offset", ends={"offset": (16e3, False)}) == "contradicted-by-reading"
    assert reason("constant-force", ends={"force": (17.0, False)}) == "supported"


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


def test_where_an_unmodelled_effect_acts_every_candidate_stands_for_itself(monkeypatch: pytest.MonkeyPatch):
    """Bristles that took 94 % of a force's disturbance in seven blocks had p = 0.003: not significant among 30."""
    monkeypatch.setattr(selection, "is_complete", lambda data, fitted: False)
    some = [candidate("extra-mass", p_value=p) for p in (0.019, 0.0028, 0.021)]
    assert [d.reason for d in apply_tests(diagnosis_data(), some)] == ["supported", "supported", "not-significant"]
    assert apply_tests(diagnosis_data(), []) == []


def test_supported_candidates_are_those_of_the_decisions_with_that_reason():
    good, bad = candidate("friction-asymmetry", ends=INSIDE), candidate("extra-mass", p_value=0.3)
    assert supported_candidates(apply_tests(diagnosis_data(), [bad, good])) == [good]
