"""Beside something unknown an effect is named only where it is more likely there than not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import decision
from pneucli.diagnose.adequacy import LackOfFit
from pneucli.diagnose.calibration import Evidence, probability
from pneucli.diagnose.candidate import Decision
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.decision import (
    collect_evidence,
    decide,
    retest_without_refused,
)
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.validity import has_unmeasured_force
from pneucli.identify.residuals import ForceBalance, ImposedMotion
from pneucli.physics.effects import catalogue
from tests.diagnose import candidates
from tests.diagnose.candidates import candidate, diagnosis_data

STRONG = Evidence(share=0.98, significance=100.0, size=1.0, left=0.01)
WEAK = Evidence(share=0.02, significance=2.0, size=0.1)
TRIED = candidate("extra-mass")


def kinds(*each: Any, feels: bool = True) -> list[Any]:
    """Views of these kinds, which feel every effect or none, of one and the same recording."""
    residual_models = [object.__new__(kind) for kind in each]
    for residual_model in residual_models:
        residual_model.__dict__.update(experiment="fitted", is_sensitive_to=lambda effect: feels)
    return residual_models


@pytest.fixture
def judged(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The decision about an effect with evidence, and a hard constraint that it violates."""

    def reason(
        evidence: Evidence,
        *,
        unknown: bool,
        violated: str | None = None,
        read: float | None = None,
        law: bool = False,
    ) -> str:
        place = None if read is None else Term(TRIED, ())
        monkeypatch.setattr(DiagnosisData, "exclusive_channel_costs", lambda self, model_fit, effect: [(read, 100.0)])
        monkeypatch.setattr(decision, "collect_evidence", lambda *_, complete: evidence._replace(complete=complete))
        monkeypatch.setattr(decision, "violated_constraint", lambda *_, **__: violated)
        monkeypatch.setattr(
            decision, "nonparametric_rival", lambda diagnosis_data, one: "a law" if law and one is place else None
        )
        left = [LackOfFit(ForceBalance, "force", 5.0, 5.0, ())] * unknown
        found, rests_on = decide(diagnosis_data(), TRIED.full, TRIED, left, place)
        assert (found.effect, found.candidate) == (TRIED.effect, TRIED)
        assert rests_on == evidence._replace(complete=not unknown)
        return found.reason

    return reason


@pytest.mark.parametrize("unknown", [False, True])
def test_only_a_probable_effect_is_named(judged: Any, unknown: bool) -> None:
    assert probability(WEAK) < 0.5 < probability(STRONG)
    assert judged(STRONG, unknown=unknown) == "supported"
    assert judged(WEAK, unknown=unknown) == "explained-by-unknown"


@pytest.mark.parametrize("unknown", [False, True])
def test_an_effect_with_a_smooth_rival_is_not_named_however_probable(judged: Any, unknown: bool) -> None:
    assert judged(STRONG, unknown=unknown, read=100.0, law=True) == "explained-by-signal"
    assert judged(WEAK, unknown=unknown, read=100.0, law=True) == "explained-by-unknown"


@pytest.mark.parametrize("unknown", [False, True])
def test_an_exclusive_measurement_has_no_smooth_rival(judged: Any, unknown: bool) -> None:
    assert judged(STRONG, unknown=unknown, read=200.0, law=True) == "supported"


@pytest.mark.parametrize("unknown", [False, True])
@pytest.mark.parametrize("evidence", [STRONG, WEAK])
def test_no_probability_outweighs_a_hard_constraint(judged: Any, evidence: Evidence, unknown: bool) -> None:
    assert judged(evidence, unknown=unknown, violated="interval-contains-null") == "interval-contains-null"


@pytest.mark.parametrize("unseen", [True, False])
def test_an_unmeasured_force_names_no_effect(unseen: bool) -> None:
    """Without p2 what a shut chamber 2 does to the piston looks like a spring."""
    residual_model = object.__new__(ForceBalance)
    experiment = SimpleNamespace(p2_is_unmeasured=unseen, can_show=lambda effect: True)
    object.__setattr__(residual_model, "experiment", experiment)
    assert has_unmeasured_force([residual_model], catalogue()["spring-force"]) == unseen
    assert not has_unmeasured_force([], catalogue()["spring-force"])


# --- what it rests on


def model_fit(squares: float, samples: int = 100, **more: Any) -> Any:
    return SimpleNamespace(cost=squares, residual_count=samples, **more)


def evidence(monkeypatch: pytest.MonkeyPatch, shown: Any, *, complete: bool = False, placed: bool = True) -> Evidence:
    free = [SimpleNamespace(name="friction.coulomb"), SimpleNamespace(name="extra-mass.mass")]
    fitted: Any = SimpleNamespace(free=free, covariance=np.diag([1.0, 0.5]))
    widened: Any = SimpleNamespace(covariance=np.diag([9.0, 2.0]))
    last = model_fit(140.0, fit=fitted, model="last model")
    tried: Any = SimpleNamespace(
        reduced=model_fit(0.0, model="without"), full=model_fit(0.0, model="with"), effect=catalogue()["extra-mass"]
    )
    where: Any = SimpleNamespace(train=kinds(ForceBalance), free_run_errors=shown, with_intervals=lambda one: widened)
    monkeypatch.setattr(decision, "rig_quantities", lambda model, experiments: (model, *experiments))
    sizes = {("extra-mass", ("last model", "fitted")): 0.5}
    monkeypatch.setattr(decision, "significance", lambda fit, effect, *_: 40.0 if fit is fitted else 0.0)
    monkeypatch.setattr(decision, "relative_effect_size", lambda fit, effect, facts, *_: sizes[effect.name, facts])
    path_step: Any = SimpleNamespace(
        reduced=model_fit(0.0, model="start"), full=model_fit(0.0, model="first step"), effect=tried.effect
    )
    term: Any = SimpleNamespace(
        candidate=tried, remaining_variance=lambda diagnosis_data: 0.2 if diagnosis_data is where else None
    )
    return collect_evidence(where, last, path_step, term if placed else None, complete=complete)


def test_evidence_is_of_the_effect_beside_all_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """40 standard errors by blocks of time are 20 of the interval, whose variance model error inflates by 4."""
    errors = {"without": {"train": 9.0, "test": 5.0}, "with": {"train": 8.0, "test": 13.0**0.5}}
    for complete in (True, False):
        found = evidence(monkeypatch, errors.__getitem__, complete=complete)
        assert found[:3] == pytest.approx((0.5, 20.0, 0.5))
        assert found[3:] == (complete, 0.2)


def test_without_free_run_errors_the_share_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    assert evidence(monkeypatch, None).share is None


def test_without_a_term_everything_remains(monkeypatch: pytest.MonkeyPatch) -> None:
    assert evidence(monkeypatch, None, placed=False).left == 1.0


def test_the_posterior_uses_the_evidence_of_the_term(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What it takes of the error that the user sees counts, too: of 4 and 2 times the noise 12 of 15 parts."""
    tried = candidate("time-skew", before=candidates.model_fit())
    errors = {id(tried.reduced.model): 4.0, id(tried.full.model): 2.0}
    where = replace(
        diagnosis_data(held_out=False),
        train=kinds(ImposedMotion, ForceBalance),
        free_run_errors=lambda model: {"train": 9.0, "test": errors[id(model)]},
    )
    monkeypatch.setattr(
        decision, "rig_quantities", lambda model, experiments: "facts" if model is tried.full.model else None
    )
    monkeypatch.setattr(decision, "significance", lambda fit, effect, *_: 20.0 if fit is tried.full.fit else 0.0)
    monkeypatch.setattr(DiagnosisData, "with_intervals", lambda self, fitted: fitted.fit)
    monkeypatch.setattr(
        decision, "relative_effect_size", lambda fit, effect, facts, *_: 0.5 if facts == "facts" else 0.0
    )
    monkeypatch.setattr(
        Term, "remaining_variance", lambda self, diagnosis_data: 0.3 if self.candidate is tried else None
    )
    monkeypatch.setattr(Term, "equivalents", lambda self, diagnosis_data, complete: () if complete else self.rivals)
    known = Evidence(0.8, 20.0, 0.5, complete=False, left=0.3)
    assert decision.posterior_probability(where, Term(tried, ())) == probability(known)


@pytest.mark.parametrize(
    ("errors", "expected"),
    [
        (None, np.log(3.0)),
        ({"train": 2.0, "test": None}, np.log(3.0) - 10.0 * np.log(2.0)),
        ({"train": 2.0, "test": 8.0}, np.log(3.0) - 10.0 * np.log(4.0)),
    ],
)
def test_among_equivalents_the_free_run_error_counts_as_ten_readings(
    monkeypatch: pytest.MonkeyPatch, errors: dict[str, float | None] | None, expected: float
) -> None:
    """Stribeck friction and a break-away that grows leave as much of a balance of forces, which has few break-aways."""
    monkeypatch.setattr(decision, "_evidence_of_fit", lambda *_: WEAK)
    monkeypatch.setattr(decision, "probability", lambda evidence: 0.75)
    where = replace(diagnosis_data(held_out=False), free_run_errors=None if errors is None else lambda model: errors)
    assert decision.log_odds_among_equivalents(
        where, candidate("stribeck", before=candidates.model_fit())
    ) == pytest.approx(expected)
    monkeypatch.setattr(decision, "probability", lambda evidence: 1.0)
    named = candidate("stribeck", before=candidates.model_fit())
    assert np.isfinite(decision.log_odds_among_equivalents(where, named))


def test_among_equivalents_the_intercepts_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """The unknown that one of them resembles, all of them do."""
    where = replace(diagnosis_data(held_out=False), free_run_errors=None)
    monkeypatch.setattr(decision, "_significance_and_size", lambda diagnosis_data, model_fit, effect: (20.0, 0.5))
    monkeypatch.setattr(Term, "remaining_variance", lambda self, diagnosis_data: 0.3)
    clock, spool = (
        decision.log_odds_among_equivalents(where, candidate(n, before=candidates.model_fit()))
        for n in ("time-skew", "valve-lag")
    )
    assert clock == spool


@pytest.mark.parametrize(("size", "less"), [(0.5, True), (1.0, False), (4.0, False)])
def test_a_size_above_typical_is_no_more_probable_among_equivalents(
    monkeypatch: pytest.MonkeyPatch, size: float, less: bool
) -> None:
    """Of a force of its usual size and an offset of four times its own a rig has rather the force."""
    where = replace(diagnosis_data(held_out=False), free_run_errors=None)
    sizes = {"constant-force": 1.0, "pressure-offset": size}
    monkeypatch.setattr(
        decision, "_significance_and_size", lambda diagnosis_data, model_fit, effect: (20.0, sizes[effect.name])
    )
    monkeypatch.setattr(Term, "remaining_variance", lambda self, diagnosis_data: 0.3)
    force, offset = (
        decision.log_odds_among_equivalents(where, candidate(name, before=candidates.model_fit())) for name in sizes
    )
    assert offset < force if less else offset == force


@pytest.mark.parametrize(
    ("moved", "passes", "named"),
    [
        ((10.0, 5.0), True, "supported"),
        ((10.0, 10.5), True, "raises-error"),
        ((10.0, 9.9), False, "explained-by-unknown"),
    ],
)
def test_a_named_effect_must_pass_without_the_refused_ones(
    monkeypatch: pytest.MonkeyPatch, moved: tuple[float, float], passes: bool, named: str
) -> None:
    """An offset is refused; the mass beside it must pass, and lower the error, in the model that lacks the offset."""
    mass, offset = (candidate(n) for n in ("extra-mass", "pressure-offset"))
    last, alone, neither = (candidates.model_fit(n) for n in (["extra-mass", "pressure-offset"], ["extra-mass"], []))
    ways = {(id(last), "pressure-offset"): alone, (id(alone), "extra-mass"): neither}
    monkeypatch.setattr(DiagnosisData, "refit_without", lambda self, one, effects: [ways[id(one), effects[0].name]])
    step = replace(mass, reduced=neither, full=alone)
    monkeypatch.setattr(DiagnosisData, "candidate", lambda self, before, after, effect: step)
    monkeypatch.setattr(decision, "passing_candidates", lambda diagnosis_data, before, tried: tried if passes else [])
    there = STRONG if passes else WEAK
    monkeypatch.setattr(decision, "collect_evidence", lambda *_, complete: there._replace(complete=complete))
    rises = moved[1] > moved[0]
    monkeypatch.setattr(decision, "violated_constraint", lambda *_, **__: "raises-error" if rises else None)
    found = diagnosis_data()
    left = [LackOfFit(ForceBalance, "force", 5.0, 5.0, ())]
    refusal = "explained-by-unknown"
    weights = [(Decision(mass.effect, "supported", mass), STRONG), (Decision(offset.effect, refusal, offset), WEAK)]
    (first, _), (second, _) = retest_without_refused(found, last, weights, left)
    assert (first.reason, second.reason) == (named, refusal)
    assert retest_without_refused(found, last, weights, []) == weights  # noise alone is left
    assert retest_without_refused(found, last, weights[:1], left) == weights[:1]  # nothing is refused
    assert retest_without_refused(found, last, weights[1:], left) == weights[1:]  # nothing is named


@pytest.mark.parametrize(("left", "likely", "named"), [(5.0, False, False), (5.0, True, True), (1.0, False, True)])
def test_with_a_smooth_rival_the_residual_is_tested_again(
    monkeypatch: pytest.MonkeyPatch, left: float, likely: bool, named: bool
) -> None:
    """With a spring, which a law outdoes, the mass seemed to be complete; it is weighed anew beside what is left."""
    mass, spring = (candidate(n) for n in ("extra-mass", "spring-force"))
    last, alone, neither = (candidates.model_fit(n) for n in (["extra-mass", "spring-force"], ["extra-mass"], []))
    ways = {(id(last), "spring-force"): alone, (id(alone), "extra-mass"): neither}
    monkeypatch.setattr(DiagnosisData, "refit_without", lambda self, one, effects: [ways[id(one), effects[0].name]])
    monkeypatch.setattr(
        DiagnosisData, "candidate", lambda self, before, after, effect: replace(mass, reduced=before, full=after)
    )
    monkeypatch.setattr(decision, "passing_candidates", lambda diagnosis_data, before, tried: tried)
    monkeypatch.setattr(
        decision,
        "lack_of_fit",
        lambda diagnosis_data, one: (
            [LackOfFit(ForceBalance, "force", left, left, ())] * (one.model is alone.model),
            [],
        ),
    )
    there = STRONG if likely else WEAK
    monkeypatch.setattr(decision, "collect_evidence", lambda *_, complete: there._replace(complete=complete))
    monkeypatch.setattr(decision, "violated_constraint", lambda *_, **__: None)
    monkeypatch.setattr(decision, "nonparametric_rival", lambda diagnosis_data, one: None)
    found = diagnosis_data([(neither, 10.0, 10.0), (alone, 5.0, 5.0)])
    weights = [
        (Decision(mass.effect, "supported", mass), STRONG._replace(complete=True)),
        (Decision(spring.effect, "explained-by-signal", spring), STRONG),
    ]
    (first, evidence), (second, _) = retest_without_refused(found, last, weights, [])
    assert (first.supported, second.reason) == (named, "explained-by-signal")
    assert evidence.complete == (left == 1.0)
