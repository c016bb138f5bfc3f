"""Describing what remains: of what it is a function, as what it acts, and where nothing of that can be said."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import discrepancy
from pneucli.diagnose.adequacy import LackOfFit
from pneucli.diagnose.discrepancy import PeriodicTerm, UnexplainedResidual, describe_lack_of_fit
from pneucli.diagnose.spline_regression import SmoothTerm
from pneucli.identify.residuals import ChamberPressures, ForceBalance, FreeRun, ImposedMotion
from pneucli.messages.diagnose import FREE_RUN, SHAPELESS, discrepancy_kind_text

VIEW: Any = ForceBalance(SimpleNamespace())  # type: ignore[arg-type]
VIEW.__dict__["channels"] = ("force",)


def law(signal: str, share: float, way: str = "force") -> SmoothTerm:
    """A law that explains a share."""
    return SmoothTerm(signal, way, "N", 0, share, 0.0, 1.0, np.zeros(60), 1.0)


def text(found: UnexplainedResidual) -> str:
    """The words of the answer."""
    return discrepancy_kind_text(found.kind, found.acts_as, found.variable, share=found.share, period=found.period)


def described(
    monkeypatch: pytest.MonkeyPatch, *laws: SmoothTerm, repeats: PeriodicTerm | None = None, simple: str | None = None
) -> UnexplainedResidual:
    """What is said of a remainder of the force of which these laws and this period are known."""
    ranked = sorted(laws, key=lambda one: -one.share)
    known = SimpleNamespace(
        ranked_terms=lambda fit: ranked, simplest_shape=lambda fit, one: simple if one is ranked[0] else "another"
    )
    diagnosis_data = SimpleNamespace(
        train=[VIEW], spline_regression=lambda fit, *one: {(ForceBalance, "force"): known}[one]
    )
    monkeypatch.setattr(discrepancy, "find_period", lambda *_: repeats)
    return describe_lack_of_fit(
        diagnosis_data, SimpleNamespace(model=None), LackOfFit(ForceBalance, "force", 3.0, 3.0, ())
    )  # type: ignore[arg-type]


def test_the_discrepancy_is_a_function_of_the_signal_with_the_largest_share(monkeypatch: pytest.MonkeyPatch) -> None:
    found = described(monkeypatch, law("x", 0.9, "dry friction"), law("p1", 0.5), simple="parabola")
    assert (found.subsystem, found.channel, found.ratio) == (ForceBalance.title, "force", 3.0)
    assert (found.variable, found.share, found.simple_shape, found.other_signals) == ("x", 0.9, "parabola", ())
    assert text(found) == "a dry friction, a function of piston position"
    assert found.smooth_term is not None
    assert (found.smooth_term.signal, found.smooth_term.acts_as) == ("x", "dry friction")


def test_a_function_of_time_is_a_drift(monkeypatch: pytest.MonkeyPatch) -> None:
    assert text(described(monkeypatch, law("time", 0.9))) == "a force that drifts over each recording"


def test_signals_with_about_the_same_share_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """They leave 0.1, 0.14 and 0.15: ten independent readings vary by 1.47, as the answer's sets of effects have it."""
    found = described(monkeypatch, law("p1", 0.9), law("p2", 0.86), law("p1", 0.88, "dry friction"), law("x", 0.85))
    assert found.other_signals == ("p2",)


def test_quantities_with_about_the_same_share_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the velocity a force, a dry and a viscous friction may be one: they leave 0.1, 0.14 and 0.5."""
    ways = law("v", 0.9), law("v", 0.86, "dry friction"), law("v", 0.5, "viscous friction"), law("p1", 0.86, "flow")
    assert text(described(monkeypatch, *ways)) == "a force or a dry friction, a function of piston velocity"


def test_a_small_share_is_irregular(monkeypatch: pytest.MonkeyPatch) -> None:
    """What leaves 0.7 leaves about as much as what explains nothing."""
    found = described(monkeypatch, law("x", 0.3), law("p1", 0.29))
    assert (found.variable, found.other_signals) == ("x", ())
    assert text(found) == "mostly irregular; 30 % of it is a force, a function of piston position"


def test_a_negligible_share_is_shapeless(monkeypatch: pytest.MonkeyPatch) -> None:
    found = described(monkeypatch, law("x", 0.04))
    assert (found.variable, found.share) == (None, None)
    assert text(found) == SHAPELESS
    assert described(monkeypatch).variable is None
    assert described(monkeypatch, law("x", 0.06)).variable == "x"


def test_a_period_over_the_same_signal_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    found = described(monkeypatch, law("x", 0.9), repeats=PeriodicTerm("x", 0.02, 0.6))
    assert (found.variable, found.kind, found.share) == ("x", "periodic", 0.9)
    assert text(found) == "a force that repeats over piston position, period 20 mm"
    assert found.smooth_term is not None
    assert found.smooth_term.signal == "x"


def test_a_period_over_time_without_a_smooth_term_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such as a load that swings on a spring: no signal has its phase."""
    found = described(monkeypatch, law("x", 0.1), repeats=PeriodicTerm("time", 0.12, 0.6))
    assert (found.variable, found.share, found.smooth_term) == ("time", 0.6, None)
    assert text(found) == "something that repeats over time, period 0.12 s"
    assert described(monkeypatch, repeats=PeriodicTerm("time", 0.12, 0.4)).variable == "time"


def test_a_smooth_term_with_a_larger_share_precedes_a_period(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is a function of the position comes back with the motion."""
    assert described(monkeypatch, law("x", 0.9), repeats=PeriodicTerm("time", 1.0, 0.6)).variable == "x"


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (ChamberPressures, "gas, valve and their sensors"),
        (FreeRun, "the complete simulation"),
        (ImposedMotion, "mechanics: friction, load or a force on the piston"),
    ],
)
def test_without_a_fitted_residual_the_free_run_alone_fails(kind: Any, words: str) -> None:
    found = describe_lack_of_fit(SimpleNamespace(train=[VIEW]), None, LackOfFit(kind, "x", 2.0, 2.0, ()))  # type: ignore[arg-type]
    assert (found.subsystem, found.channel, text(found)) == (words, "x", FREE_RUN)
    assert found.variable is None
