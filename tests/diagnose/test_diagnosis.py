"""The diagnosis as a whole: which of the effects found are named, what the verdict is, and the errors of the ladder."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import diagnosis, free_run_error
from pneucli.diagnose.adequacy import LackOfFit
from pneucli.diagnose.calibration import Evidence, presence_rate, probability
from pneucli.diagnose.candidate import Candidate, Decision, Reason
from pneucli.diagnose.evidence import ScoreGain
from pneucli.diagnose.selection import SelectionPath
from pneucli.identify.residuals import ForceBalance, FreeRun
from tests.diagnose.synthetic_data import SyntheticData, adding, effect

A, B, C, D = (effect(name) for name in "abcd")
RESTS_ON = {"a": Evidence(0.8, 50.0, 1.0), "b": Evidence(0.2, 9.0, 0.3)}
CERTAIN = {name: probability(evidence) for name, evidence in RESTS_ON.items()}
MUCH = LackOfFit(ForceBalance, "force", 5.0, 5.0, ())
ASTRAY = LackOfFit(FreeRun, "x", 3.0, 3.0, ())


class Diagnosed:
    """A diagnosis whose search ended after ``a`` and ``b``; what is left over and what stands is stated."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **given: Any) -> None:
        self.toys = SyntheticData([A, B], adding(a=0.6, b=0.4))
        self.rungs = tuple(self.toys.model_with(names) for names in ([], ["a"], ["a", "b"]))
        for rung in self.rungs:
            rung.fit.estimates[:] = []  # type: ignore[index]
        self.steps: list[tuple[str, list[str], list[str], bool]] = []
        self.described: list[tuple[list[str], LackOfFit]] = []
        none, left = ScoreGain(1.0, 0.0, 1.0, 1.0), given.get("left", [])
        rival = Candidate(given.get("equals", A), self.rungs[0], self.rungs[-1], none, none, 0.0)
        unknown = bool(left or given.get("astray"))

        def place(one: Any, rivals: list[Candidate]) -> Any:
            return SimpleNamespace(
                candidate=Candidate(one, self.rungs[0], self.rungs[-1], none, none, 0.0),
                equivalents=lambda diagnosis_data, *, complete: rivals if complete != unknown else None,
            )

        places = {"a": place(A, []), "b": place(B, [rival])}
        found = SelectionPath(self.rungs, places, tuple(given.get("refused", ())), tuple(left), ())
        standing = given.get("standing", {"a", "b"})

        def weighed(
            diagnosis_data: Any, last: Any, step: Candidate, left: Any, place: Any
        ) -> tuple[Decision, Evidence]:
            assert place is places[step.effect.name]
            self.steps.append((step.effect.name, step.reduced.effect_names, step.full.effect_names, bool(left)))
            stands = step.effect.name in standing or not (left or step.effect.name in given.get("doubted", ()))
            reason: Reason = "supported" if stands else given.get("why", "explained-by-unknown")
            return Decision(step.effect, reason, step), RESTS_ON[step.effect.name]

        def without_refused(diagnosis_data: Any, last: Any, weights: Any, left: Any) -> Any:
            assert bool(left) == unknown
            falls = given.get("falls", ())
            return [(replace(d, reason="raises-error") if d.effect.name in falls else d, e) for d, e in weights]

        def describe(diagnosis_data: Any, fit: Any, worst: LackOfFit) -> str:
            self.described.append(([e.name for e in fit.model.effects], worst))
            return "unknown"

        monkeypatch.setattr(diagnosis, "select_effects", lambda diagnosis_data, start: found)
        monkeypatch.setattr(diagnosis, "free_run_lack_of_fit", lambda model, residual_models: given.get("astray", []))
        monkeypatch.setattr(
            diagnosis, "lack_of_fit", lambda diagnosis_data, model_fit: (given.get("remains", [MUCH]), [])
        )
        monkeypatch.setattr(diagnosis, "violated_constraint", lambda *_: given.get("violated"))
        monkeypatch.setattr(diagnosis, "decide", weighed)
        monkeypatch.setattr(diagnosis, "retest_without_refused", without_refused)
        odds = np.log([1.0, 9.0])
        monkeypatch.setattr(
            diagnosis, "log_odds_among_equivalents", lambda diagnosis_data, one: odds[0] if one is rival else odds[1]
        )
        monkeypatch.setattr(diagnosis, "describe_lack_of_fit", describe)
        self.sizes = [SimpleNamespace(typical=typical) for typical in given.get("typical", [True])]
        monkeypatch.setattr(
            diagnosis,
            "minimum_detectable_effects",
            lambda diagnosis_data, model_fit: self.sizes if model_fit is found.last else [],
        )
        monkeypatch.setattr(
            diagnosis, "describe_discrepancies", lambda diagnosis_data, fit, left: [(fit.model, len(left))]
        )
        monkeypatch.setattr(diagnosis, "undetectable_effects", lambda diagnosis_data, sizes: [])
        self.bench: Any = SimpleNamespace(
            fitted_model=lambda base: self.rungs[0], train=given.get("train", []), held_out=[],
            effects=self.toys.effects, candidate=self.toys.candidate, implausible=given.get("implausible", False),
        )  # fmt: skip
        self.result = diagnosis.diagnose(self.bench, None)  # type: ignore[arg-type]

    def of_nothing(self, monkeypatch: pytest.MonkeyPatch) -> diagnosis.Diagnosis:
        """The diagnosis where the search added nothing."""
        alone = SelectionPath(self.rungs[:1], {}, (), (), ())
        monkeypatch.setattr(diagnosis, "select_effects", lambda diagnosis_data, start: alone)
        monkeypatch.setattr(diagnosis, "minimum_detectable_effects", lambda diagnosis_data, model_fit: self.sizes)
        return diagnosis.diagnose(self.bench, None)  # type: ignore[arg-type]

    @property
    def reasons(self) -> dict[str, str]:
        return {d.effect.name: d.reason for d in self.result.decisions}


def test_with_a_white_residual_every_added_effect_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    d = Diagnosed(monkeypatch)
    assert (d.result.verdict, d.result.missing, d.result.unexplained) == ("missing-effect", ("a", "b"), None)
    assert d.result.equivalents == {"a": (), "b": ("a",)}
    assert d.result.detectable == tuple(d.sizes)
    assert d.steps == [("a", [], ["a"], False), ("b", ["a"], ["a", "b"], False)]
    assert d.reasons == {"a": "supported", "b": "supported"}


@pytest.mark.parametrize("given", [{"left": [MUCH]}, {"astray": [ASTRAY]}])
def test_with_an_unmodelled_effect_only_supported_effects_are_named(
    monkeypatch: pytest.MonkeyPatch, given: dict[str, Any]
) -> None:
    d = Diagnosed(monkeypatch, standing={"b"}, **given)
    assert (d.result.verdict, d.result.missing, d.result.unexplained) == ("unexplained", ("b",), "unknown")
    assert d.steps == [("a", [], ["a"], True), ("b", ["a"], ["a", "b"], True)]
    assert d.reasons == {"a": "explained-by-unknown", "b": "supported"}
    assert d.described == [(["a", "b"], (given.get("left") or given["astray"])[0])]


def test_an_effect_with_a_smooth_rival_leaves_an_unexplained_residual(monkeypatch: pytest.MonkeyPatch) -> None:
    """The model without it passed for noise; what the effect acted in is described, the largest there."""
    faint = [LackOfFit(ForceBalance, c, r, r, ()) for c, r in (("a", 1.01), ("force", 1.04))]
    elsewhere = LackOfFit(FreeRun, "x", 1.05, 1.05, ())
    felt = object.__new__(ForceBalance)
    felt.__dict__["is_sensitive_to"] = lambda effect: effect is B
    left = [elsewhere, *faint]
    d = Diagnosed(monkeypatch, doubted={"b"}, standing={"a"}, why="explained-by-signal", remains=left, train=[felt])
    assert (d.result.verdict, d.result.missing, d.result.unexplained) == ("unexplained", ("a",), "unknown")
    assert d.described == [(["a"], faint[1])]
    assert d.result.confidence["b"].of_set == presence_rate("explained-by-signal")
    assert "b" not in d.result.evidence


def test_an_effect_that_fails_without_the_refused_ones_is_not_named(monkeypatch: pytest.MonkeyPatch) -> None:
    d = Diagnosed(monkeypatch, left=[MUCH], standing={"b"}, falls={"b"})
    assert (d.result.missing, d.reasons) == ((), {"a": "explained-by-unknown", "b": "raises-error"})


def test_without_named_effects_the_residual_of_the_first_model_is_described(monkeypatch: pytest.MonkeyPatch) -> None:
    d = Diagnosed(monkeypatch, left=[MUCH], standing=set())
    assert (d.result.verdict, d.result.missing) == ("unexplained", ())
    assert [names for names, _ in d.described] == [[]]


@pytest.mark.parametrize(("doubted", "missing", "described"), [("ab", (), []), ("b", ("a",), ["a"])])
def test_the_reduction_by_an_unnamed_effect_is_unexplained(
    monkeypatch: pytest.MonkeyPatch, doubted: str, missing: tuple[str, ...], described: list[str]
) -> None:
    """With it nothing but noise is left; without it, as the answer has it, the model errs."""
    d = Diagnosed(monkeypatch, standing=set(), doubted=doubted)
    assert (d.result.verdict, d.result.missing, d.result.unexplained) == ("unexplained", missing, "unknown")
    assert [names for names, _ in d.described] == [described]


def test_no_effect_and_no_lack_of_fit_is_adequate(monkeypatch: pytest.MonkeyPatch) -> None:
    found = Diagnosed(monkeypatch).of_nothing(monkeypatch)
    assert (found.verdict, found.missing, found.unexplained, dict(found.equivalents)) == ("adequate", (), None, {})


@pytest.mark.parametrize(
    ("typical", "verdict"),
    [
        ([True, False], "adequate"),
        ([True, False, False], "inconclusive"),  # most effects of a typical size would not have shown
        ([], "adequate"),
    ],
)
def test_too_many_undetectable_effects_are_inconclusive(
    monkeypatch: pytest.MonkeyPatch, typical: list[bool], verdict: str
) -> None:
    found = Diagnosed(monkeypatch, typical=typical).of_nothing(monkeypatch)
    assert (found.verdict, found.missing, found.unexplained) == (verdict, (), None)


@pytest.mark.parametrize(("left", "verdict"), [([], "missing-effect"), ([MUCH], "unexplained")])
def test_findings_precede_the_detectability(
    monkeypatch: pytest.MonkeyPatch, left: list[LackOfFit], verdict: str
) -> None:
    assert Diagnosed(monkeypatch, left=left, typical=[False]).result.verdict == verdict


@pytest.mark.parametrize("left", [[], [MUCH]])
def test_in_recordings_that_cannot_be_true_nothing_is_looked_for(
    monkeypatch: pytest.MonkeyPatch, left: list[LackOfFit]
) -> None:
    """Whatever a search would have found, and however large the residual is."""
    monkeypatch.setattr(
        diagnosis, "unsearched_path", lambda data, start: SelectionPath((start,), {}, (), tuple(left), ())
    )
    d = Diagnosed(monkeypatch, left=left, implausible=True)
    assert (d.result.verdict, d.result.missing, d.result.unexplained) == ("inconclusive", (), None)
    assert d.steps == []


def test_an_equivalent_that_violates_a_constraint_is_not_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Diagnosed(monkeypatch, equals=C).result.equivalents["b"] == ("c",)
    d = Diagnosed(monkeypatch, equals=C, violated="raises-error")
    assert d.result.equivalents["b"] == ()
    assert "c" not in d.reasons


def test_each_effect_that_was_decided_on_has_a_probability(monkeypatch: pytest.MonkeyPatch) -> None:
    """``b`` and its equal share what is known of both; one that a reason speaks against is improbable."""
    d = Diagnosed(monkeypatch, equals=C, refused=[Decision(D, "vanishes")])
    sure = d.result.confidence
    assert set(sure) == {"a", "b", "c", "d"}
    assert sure["a"] == (CERTAIN["a"], CERTAIN["a"])
    assert sure["b"].of_set == sure["c"].of_set == CERTAIN["b"]
    assert sure["b"].alone + sure["c"].alone == pytest.approx(CERTAIN["b"])
    assert sure["d"] == (presence_rate("vanishes"), presence_rate("vanishes"))


def test_with_an_unmodelled_effect_equivalents_share_by_their_log_odds(monkeypatch: pytest.MonkeyPatch) -> None:
    sure = Diagnosed(monkeypatch, left=[MUCH], equals=C).result.confidence
    assert sure["b"] == (CERTAIN["b"], pytest.approx(0.9 * CERTAIN["b"]))
    assert sure["c"] == (CERTAIN["b"], pytest.approx(0.1 * CERTAIN["b"]))


def test_an_unnamed_effect_has_a_probability(monkeypatch: pytest.MonkeyPatch) -> None:
    d = Diagnosed(monkeypatch, left=[MUCH], standing={"a"})
    assert d.result.confidence["b"] == (CERTAIN["b"], CERTAIN["b"])


def test_the_discrepancy_of_the_last_model_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Remainders of fitted recordings and of those held out."""
    d = Diagnosed(monkeypatch, left=[MUCH])
    assert d.result.discrepancies == ((d.rungs[-1].model, 1),)


def test_errors_are_over_each_models_own_noise_by_use(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three recordings, each with a channel's ratio of the model's number over the noise that it is given."""

    def compare(model: float, experiment: Any, noise: dict[str, float]) -> Any:
        ratio = model / noise["x"]
        return SimpleNamespace(results=[SimpleNamespace(use=experiment, ratio_to_noise=ratio)])

    drawn: list[float] = []

    def expected(model: float, experiments: list[str]) -> list[dict[str, float]]:
        drawn.append(model)
        return [{"x": 2.0 if use == "train" else 4.0} for use in experiments]

    monkeypatch.setattr(free_run_error, "compare", compare)
    monkeypatch.setattr(free_run_error, "expected_rms_of_all", expected)
    shown: Any = free_run_error.FreeRunErrors(["train", "test", "train"])  # type: ignore[list-item]
    first, other = 6.0, 8.0
    assert shown(first) == {"train": 3.0, "test": 1.5}
    assert shown(other) == {"train": 4.0, "test": 2.0}
    assert shown(first) == {"train": 3.0, "test": 1.5}
    assert drawn == [6.0, 8.0]  # noise is drawn once for each model
    alone: Any = free_run_error.FreeRunErrors(["train"])  # type: ignore[list-item]
    assert alone(first) == {"train": 3.0, "test": None}


def test_the_overall_error_of_a_use_is_a_root_mean_square(monkeypatch: pytest.MonkeyPatch) -> None:
    results = [SimpleNamespace(use="train", ratio_to_noise=r) for r in (3.0, 4.0)]
    monkeypatch.setattr(free_run_error, "compare", lambda model, experiment, noise: SimpleNamespace(results=results))
    monkeypatch.setattr(free_run_error, "expected_rms_of_all", lambda model, experiments: [{}])
    shown: Any = free_run_error.FreeRunErrors([None])  # type: ignore[list-item]
    assert shown(None)["train"] == pytest.approx(np.sqrt(12.5))
