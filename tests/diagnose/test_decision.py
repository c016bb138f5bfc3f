"""The judgement of an effect: where its evidence, its probability and the hard constraints meet."""

import math
from dataclasses import replace

import pytest

from pneucli.diagnose.calibration import Evidence, presence_rate, probability
from pneucli.diagnose.candidate import Reason
from pneucli.diagnose.decision import Judgement, is_complete, judge, log_odds_among_equivalents
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.score import ErrorsByUse
from pneucli.simulate.model import Model
from tests.diagnose.candidates import StatedErrors
from tests.diagnose.synthetic_data import LARGEST, READINGS, Facts, SyntheticData, alone, effect, synthetic_data

A = effect("a")


def term_of(data: SyntheticData, name: str = "a") -> Term:
    """The step from the model without effects to that with one."""
    return Term(data.candidate(data.model_with([]), data.model_with([name]), data.effects[name]), ())


def stated(excess: float, explains: float, **more: object) -> SyntheticData:
    """The data with one effect."""
    return synthetic_data([A], Facts(excess, alone(a=explains), **more))  # type: ignore[arg-type]


def judged(data: SyntheticData, *, constrained: bool = True) -> Judgement:
    return judge(data, term_of(data), constrained=constrained)


# --- evidence

UNMODELLED = stated(10.0, 0.8, size={"a": 0.5}, interval={"a": 2.0})
ONLY_NOISE = stated(10.0, 0.98, size={"a": 0.5}, interval={"a": 2.0})


def test_the_evidence_beside_an_unmodelled_effect() -> None:
    """Of a variance of 11 there remain 3; by blocks of time it is sqrt(8 / 3 N) standard errors from none.

    An interval that is twice as wide halves that. The free run does not count.
    """
    share, significance, size, complete, left = judged(UNMODELLED).evidence
    assert (share, complete) == (None, False)
    assert significance == pytest.approx(0.5 * math.sqrt(8.0 / 3.0 * READINGS), rel=1e-6)
    assert (size, left) == pytest.approx((0.5, 3.0 / 11.0))


def test_the_evidence_where_only_noise_is_left() -> None:
    """The free-run error falls from sqrt(11) to sqrt(1.2): it removes 0.98 of what its square exceeds 1 by."""
    share, significance, size, complete, left = judged(ONLY_NOISE).evidence
    assert complete
    assert share == pytest.approx(0.98)
    assert significance == pytest.approx(0.5 * math.sqrt(9.8 / 1.2 * READINGS), rel=1e-6)
    assert (size, left) == pytest.approx((0.5, 1.2 / 11.0))


def test_without_free_run_errors_the_share_is_unknown() -> None:
    assert judged(replace(ONLY_NOISE, free_run_errors=None)).evidence.share is None


# --- the decision


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (stated(10.0, 0.8), "supported"),
        (stated(10.0, 0.35), "explained-by-unknown"),
        (stated(10.0, 0.99), "supported"),
        (stated(0.4, 0.1, size={"a": 0.05}), "immaterial"),
    ],
)
def test_only_a_probable_effect_is_supported(data: SyntheticData, reason: Reason) -> None:
    """An improbable one resembles what is unmodelled, or is too small to matter where only noise is left."""
    found = judged(data)
    assert found.decision.reason == reason
    assert found.decision.candidate is not None
    assert found.decision.effect is A
    assert found.probability == probability(found.evidence)
    assert (found.probability >= 0.5) == (reason == "supported")


@pytest.mark.parametrize("explains", [0.8, 0.35, 0.99])
@pytest.mark.parametrize(
    ("violation", "reason"),
    [
        ({"raises_error": frozenset("a")}, "raises-error"),
        ({"at_bound": frozenset("a")}, "at-bound"),
        ({"interval": {"a": 200.0}}, "interval-contains-null"),
    ],
)
def test_a_violated_constraint_is_the_reason_whatever_the_probability(
    explains: float, violation: dict[str, object], reason: Reason
) -> None:
    """The probability remains that by the evidence: of effects that must go the least probable goes first."""
    data = stated(10.0, explains, **violation)
    found, free = judged(data), judged(data, constrained=False)
    assert found.decision.reason == reason
    assert (found.evidence, found.probability) == (free.evidence, free.probability)
    assert free.decision.reason in ("supported", "explained-by-unknown", "immaterial")
    assert found.probability == probability(found.evidence)


def test_an_effect_at_its_bound_may_be_the_most_probable_one() -> None:
    found = judged(stated(10.0, 0.8, at_bound=frozenset("a")))
    assert found.evidence.size == LARGEST
    assert found.probability > 0.5


def test_within_its_interval_an_effect_beside_an_unmodelled_one_is_as_rare_as_on_exams() -> None:
    found = judged(stated(10.0, 0.8, interval={"a": 200.0}), constrained=False)
    assert found.evidence.significance < 1.0
    assert found.probability == presence_rate("interval-contains-null")


@pytest.mark.parametrize(("excess", "complete"), [(0.43, True), (0.45, False)])
def test_a_model_is_complete_up_to_1_2_times_the_noise(excess: float, complete: bool) -> None:
    data = stated(excess, 0.0)
    assert is_complete(data, data.model_with([])) == complete


# --- among equivalents


@pytest.mark.parametrize(
    ("errors", "readings"),
    [
        (None, 0.0),
        ({"train": 2.0, "test": None}, 10.0 * math.log(2.0)),
        ({"train": 2.0, "test": 8.0}, 10.0 * math.log(4.0)),
    ],
)
def test_among_equivalents_the_free_run_error_counts_as_ten_readings(
    errors: ErrorsByUse | None, readings: float
) -> None:
    """Stribeck friction and a break-away that grows leave as much of a balance of forces, which has few break-aways."""

    def shown(model: Model, reference: Model | None) -> ErrorsByUse:
        assert [e.name for e in model.effects] == ["a"]
        assert reference is not None  # otherwise each equivalent would be judged in units of its own
        assert not reference.effects
        return errors or {}

    data = replace(stated(10.0, 0.8, size={"a": 0.5}), free_run_errors=None if errors is None else StatedErrors(shown))
    p = probability(Evidence(None, 100.0, 0.5, complete=False, left=3.0 / 11.0))
    assert log_odds_among_equivalents(data, term_of(data).candidate) == pytest.approx(
        math.log(p / (1.0 - p)) - readings
    )


@pytest.mark.parametrize(("size", "less"), [(0.5, True), (1.0, False), (4.0, False)])
def test_a_size_above_typical_is_no_more_probable_among_equivalents(size: float, less: bool) -> None:
    """Of a force of its usual size and an offset of four times its own a rig has rather the force."""
    names = ("force", "offset")
    data = synthetic_data([effect(n) for n in names], Facts(10.0, alone(force=0.8, offset=0.8), size={"offset": size}))
    force, offset = (log_odds_among_equivalents(data, term_of(data, name).candidate) for name in names)
    assert offset < force if less else offset == force
