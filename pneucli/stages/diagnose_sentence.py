"""The verdict of a diagnosis in a sentence or two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pneucli.diagnose.data import Errors
from pneucli.diagnose.diagnosis import BLIND, Diagnosis
from pneucli.diagnose.free_run_error import told
from pneucli.messages.diagnose import course, where


def sentence(found: Diagnosis, rungs: Sequence[Errors], rest: Mapping[str, Any] | None) -> str:
    """Return the verdict as an engineer would say it; ``rest`` is what is said of the unexplained."""
    before, after = _number(told(rungs[0])), _number(told(rungs[-1]))
    titles = {e.name: e.title.lower() for e in found.found.last.model.effects}
    named = " and ".join(f"{titles[n]} ({n})" for n in found.missing)
    if found.verdict == "adequate":
        return f"Nothing in the residual is more than noise and known uncertainty (error {after} times the noise)."
    if found.verdict == "inconclusive":
        blind = sum(not d.typical for d in found.detectable)
        of = f"{blind} of {len(found.detectable)} effects would not have shown at a typical size"
        why = "what the recordings say does not fit together" if blind <= BLIND * len(found.detectable) else of
        return f"Nothing can be said: {why} (error {after} times the noise)."
    if found.verdict == "missing-effect":
        what = "it" if len(found.missing) == 1 else "them"
        text = f"The model lacks {named}: with {what} the error goes from {before} to {after} times the noise."
        equals = sorted({e for n in found.missing for e in found.equals[n]})
        return text + (f" These recordings cannot tell it from {', '.join(equals)}." if equals else "")
    assert rest is not None
    text = f"What remains is {course(rest)}; no effect of the catalogue accounts for it: {where(rest)}."
    return text + (f" Beside it stands what helped: {named}." if named else "")


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.3g}"
