"""Beside something unknown an effect is named only where it is more likely there than not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import beside
from pneucli.diagnose.beside import agreement, evidence_of, examined, explained, told, weighed
from pneucli.diagnose.confidence import Evidence, probability
from pneucli.diagnose.remainder import Remainder
from pneucli.diagnose.smooth import Left, Smooth
from pneucli.identify.views import Forces, Imposed
from pneucli.physics.effects import catalogue
from tests.diagnose.trials import bench, trial
from tests.simulate.benches import bench as recorded
from tests.simulate.benches import clock

STRONG = Evidence(share=0.98, disagreement=0.01, unknown=0.0, gain=1.0, clear=False)
WEAK = Evidence(share=0.02, disagreement=1.0, unknown=1.2, gain=0.002, clear=False)
TRIED = trial("extra-mass")


@pytest.fixture
def judged(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The decision about an effect with evidence, a reading that contradicts it, and the error that the user sees."""

    def reason(evidence: Evidence, *, unknown: bool, contradicted: bool = False, falls: bool = True) -> str:
        monkeypatch.setattr(beside, "evidence_of", lambda *_, clear: evidence._replace(clear=clear))
        monkeypatch.setattr(beside, "contradicted", lambda model, effect, views: contradicted)
        errors = [(TRIED.before, 10.0, 10.0), (TRIED.state, *((5.0, 5.0) if falls else (10.5, 10.5)))]
        left = [Remainder(Forces, "force", 5.0, 5.0, ())] * unknown
        monkeypatch.setattr(beside, "examined", lambda bench, effect: True)
        decision, rests_on = weighed(bench(errors), TRIED.state, TRIED, left)
        assert (decision.effect, decision.trial) == (TRIED.effect, TRIED)
        assert rests_on == evidence._replace(clear=not unknown)
        return decision.reason

    return reason


def test_beside_something_unknown_only_what_is_likely_there_is_named(judged: Any) -> None:
    assert probability(WEAK) < 0.5 < probability(STRONG)
    assert judged(STRONG, unknown=True) == "supported"
    assert judged(WEAK, unknown=True) == "explained-by-unknown"


def test_where_nothing_unknown_is_left_what_was_found_is_named(judged: Any) -> None:
    assert judged(WEAK, unknown=False) == "supported"
    assert judged(WEAK, unknown=False, falls=False) == "supported"


def test_beside_something_unknown_the_error_that_the_user_sees_must_fall(judged: Any) -> None:
    assert judged(STRONG, unknown=True, falls=False) == "raises-error"
    assert judged(WEAK, unknown=True, falls=False) == "explained-by-unknown"


@pytest.mark.parametrize("unknown", [False, True])
def test_what_a_reading_contradicts_is_not_named_however_likely(judged: Any, unknown: bool) -> None:
    assert judged(STRONG, unknown=unknown, contradicted=True) == "contradicted-by-reading"


# --- where no exam tells


@pytest.mark.parametrize(
    ("share", "disagreement", "ratio", "held_out", "named"),
    [
        (0.70, 0.3, 5.0, True, True),  # 70 % taken, and much left: two things act
        (0.70, 0.3, 2.0, True, False),  # 70 % taken, little left: what resembles one unknown does the same
        (0.98, 0.3, 2.0, True, True),
        (0.10, 0.3, 9.0, True, False),
        (0.98, 0.6, 9.0, True, False),  # recordings want it changed by more than half
        (0.80, 0.0, 9.0, False, False),  # nothing was held out to contradict it
        (0.95, 0.6, 9.0, False, True),
    ],
)
def test_where_no_exam_tells_an_effect_takes_most_or_much_is_left(
    share: float, disagreement: float, ratio: float, held_out: bool, named: bool
) -> None:
    evidence = Evidence(share, disagreement, 0.0, 0.1, clear=False)
    left = [Remainder(Forces, "force", ratio, ratio, ())]
    assert told(bench(held_out=held_out), evidence, left) == named


@pytest.mark.parametrize(
    ("kind", "held_out", "known"), [(Forces, True, True), (Imposed, True, False), (Forces, False, False)]
)
def test_exams_have_free_motion_and_hold_recordings_out(kind: Any, held_out: bool, known: bool) -> None:
    seen = kind(recorded("friction", clock(0.1), {"p1": 3e5, "p2": 3e5, "x": 0.1}))
    where: Any = SimpleNamespace(train=[seen], checked=held_out)
    assert examined(where, catalogue()["stribeck"]) == known


# --- what it rests on


def state(squares: float, samples: int = 100, deviance: float = 0.0, **more: Any) -> Any:
    return SimpleNamespace(cost=squares, samples=samples, deviance=deviance, **more)


def test_the_share_that_a_step_takes_is_of_what_exceeds_noise() -> None:
    assert explained(state(300.0), state(150.0)) == pytest.approx(0.75)
    assert explained(state(300.0), state(350.0)) == pytest.approx(-0.25)


@pytest.mark.parametrize(("rival", "unknown"), [(30.0, 0.25), (180.0, 1.5), (None, 0.0)])
def test_evidence_holds_a_smooth_function_of_the_state_before_against_the_effect(
    monkeypatch: pytest.MonkeyPatch, rival: float | None, unknown: float
) -> None:
    before, after, last = state(300.0, deviance=500.0), state(150.0, deviance=380.0), state(140.0)
    tried: Any = SimpleNamespace(before=before, state=after, effect=catalogue()["extra-mass"])
    where: Any = SimpleNamespace(train=["fitted"], held_out=["apart"])
    asked = []

    def strongest(left: Any, effect: Any) -> Smooth | None:
        asked.append((left, effect.name))
        return Smooth("force", "x", rival) if rival is not None else None

    monkeypatch.setattr(Left, "by", lambda *given: given)
    monkeypatch.setattr(beside, "strongest", strongest)
    monkeypatch.setattr(beside, "agreement", lambda bench, state, name: {"extra-mass": 0.3}[name] * (state is last))
    found = evidence_of(where, last, tried, clear=True)
    assert asked == [((before, ["fitted"], ["apart"]), "extra-mass")]
    assert found == pytest.approx(Evidence(0.75, 0.3, unknown, 1.2, clear=True))


def test_recordings_are_asked_each_by_all_its_views(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two views of ``b`` count as one recording; every channel has its residuals."""

    def view(name: str, n: int, *channels: str) -> Any:
        experiment = SimpleNamespace(recording=SimpleNamespace(name=name), time=np.zeros(n))
        return SimpleNamespace(experiment=experiment, channels=channels)

    monkeypatch.setattr(beside, "disagreement", lambda fit, effect, recordings: (fit, effect.name, recordings.tolist()))
    where: Any = SimpleNamespace(
        train=[view("b", 2, "p1", "p2"), view("a", 3, "p1"), view("b", 1, "force")], effects=catalogue()
    )
    fit, name, recordings = agreement(where, SimpleNamespace(fit="fit"), "extra-mass")  # type: ignore[misc, arg-type]
    assert (fit, name, recordings) == ("fit", "extra-mass", [1] * 4 + [0] * 3 + [1])
