"""Every test that a trial may fail gives its own reason, and where it ended comes before chance."""

from __future__ import annotations

import pytest

from pneucli.diagnose import constraints, hypothesis_tests
from pneucli.diagnose.adequacy import LackOfFit
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.evidence import ScoreGain
from pneucli.diagnose.hypothesis_tests import apply_tests, passing_candidates
from pneucli.identify.residuals import ForceBalance
from tests.diagnose.candidates import UNSURE, candidate, diagnosis_data, model_fit

MUCH = LackOfFit(ForceBalance, "force", 5.0, 5.0, ())
INSIDE = {"asymmetry": (0.2, False), "viscous_asymmetry": (0.1, False)}


@pytest.fixture(autouse=True)
def nothing_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hypothesis_tests, "lack_of_fit", lambda diagnosis_data, model_fit: ([], []))


def reason(*args, before=None, held_out=True, **how):
    before = before or model_fit()
    (decision,) = apply_tests(diagnosis_data(held_out=held_out), before, [candidate(*args, before=before, **how)])
    return decision.reason


def test_a_candidate_that_passes_all_tests_is_supported():
    assert reason("friction-asymmetry", ends=INSIDE) == "supported"


def test_an_effect_at_its_null_vanishes_whatever_its_p_value():
    assert reason("chamber-leak", ends={"area": (0.0, True)}, p_value=0.5) == "vanishes"


def test_bristles_that_end_as_stiff_as_may_be_are_none():
    """Their null is infinite: the bound on the way there is as good as absent."""
    ends = {"stiffness": (1e8, True), "damping": (80.0, False)}
    assert reason("presliding", ends=ends, p_value=0.5) == "vanishes"


@pytest.mark.parametrize("p_value", [1e-12, 0.7])
def test_an_effect_at_a_bound_is_refused_whatever_its_p_value(p_value: float):
    assert reason("friction-hysteresis", ends={"drop": (0.95, True)}, p_value=p_value) == "at-bound"


@pytest.mark.parametrize(("p_value", "said"), [(0.7, "at-bound"), (1e-9, "supported")])
def test_a_bound_of_a_parameter_without_null_counts_only_without_significance(p_value: float, said: str):
    """The time constant of a dwell at its bound: with a sure gain an instant growth, without one no finding at all."""
    ends = {"gain": (0.5, False), "time_constant": (1e-3, True)}
    assert reason("dwell-breakaway", ends=ends, p_value=p_value) == said


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


@pytest.mark.parametrize(("fall", "said"), [(31.0, "immaterial"), (33.0, "supported")])
def test_four_thousandths_of_a_cost_beyond_noise_matter(fall: float, said: str):
    assert reason("friction-asymmetry", 8000.0 - fall, ends=INSIDE) == said


@pytest.mark.parametrize(("fall", "said"), [(79.0, "immaterial"), (81.0, "supported")])
def test_at_the_noise_floor_two_percent_are_material(fall: float, said: str):
    """A cost of 4000 from 4000 samples: what is left is noise, and a hundredth of it no finding."""
    assert reason("friction-asymmetry", 4000.0 - fall, before=model_fit(cost=4000.0), ends=INSIDE) == said


def test_materiality_is_relative_to_the_sensitive_cost(monkeypatch: pytest.MonkeyPatch):
    """31 of 8000 are too little; of 1000 in the views that feel it they are not, but where noise is left there, 2 %."""
    for felt, said in (((1000.0, 500), "supported"), ((1500.0, 1500), "supported"), ((1600.0, 1600), "immaterial")):
        monkeypatch.setattr(DiagnosisData, "sensitive_cost", lambda *_, felt=felt: felt)
        assert reason("friction-asymmetry", 8000.0 - 31.0, ends=INSIDE) == said


def test_a_gain_without_held_out_confirmation_is_refused():
    assert reason("friction-asymmetry", ends=INSIDE, test=UNSURE) == "not-on-held-out"
    assert reason("friction-asymmetry", ends=INSIDE, test=UNSURE, held_out=False) == "supported"


@pytest.mark.parametrize(
    ("left", "after", "said"),
    [
        ([MUCH], 4000.0, "supported"),
        ([MUCH], 7999.0, "immaterial"),
        ([], 4000.0, "not-on-held-out"),
    ],
)
def test_with_an_unmodelled_effect_no_held_out_confirmation_is_required(
    monkeypatch: pytest.MonkeyPatch, left: list[LackOfFit], after: float, said: str
):
    monkeypatch.setattr(hypothesis_tests, "lack_of_fit", lambda diagnosis_data, model_fit: (left, []))
    assert reason("friction-asymmetry", after, ends=INSIDE, test=ScoreGain(-90.0, -100.0, 0.3, 30.0)) == said


@pytest.mark.parametrize(("error", "said"), [(4.0, "supported"), (4.9, "immaterial")])
def test_with_an_unmodelled_effect_a_clear_fall_of_the_free_run_error_suffices(
    monkeypatch: pytest.MonkeyPatch, error: float, said: str
):
    """A bristle hardly changes the balance of forces, and decides when the piston breaks away."""
    monkeypatch.setattr(hypothesis_tests, "lack_of_fit", lambda diagnosis_data, model_fit: ([MUCH], []))
    tried = candidate("friction-asymmetry", 8000.0, ends=INSIDE, test=UNSURE)
    data = diagnosis_data([(tried.reduced, 5.0, None), (tried.full, error, None)])
    (decision,) = apply_tests(data, model_fit(), [tried])
    assert decision.reason == said


def test_folds_are_held_out_data():
    by_turns = diagnosis_data(held_out=False, folds=(0,))
    (decision,) = apply_tests(by_turns, model_fit(), [candidate("friction-asymmetry", ends=INSIDE, test=UNSURE)])
    assert decision.reason == "not-on-held-out"


def test_supported_are_those_with_that_reason():
    good, bad = candidate("friction-asymmetry", ends=INSIDE), candidate("extra-mass", p_value=0.3)
    assert passing_candidates(diagnosis_data(), model_fit(), [bad, good]) == [good]
