"""The verdict of a diagnosis in a sentence or two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pneucli.diagnose.data import ErrorsByUse
from pneucli.diagnose.diagnosis import MAX_UNDETECTABLE_SHARE, Diagnosis
from pneucli.diagnose.free_run_error import held_out_error
from pneucli.messages.diagnose import discrepancy_character, discrepancy_location


def verdict_sentence(
    found: Diagnosis, path_errors: Sequence[ErrorsByUse], unexplained: Mapping[str, Any] | None
) -> str:
    """Return the verdict as an engineer would say it; ``unexplained`` is what is said of the unexplained."""
    before, after = _number(held_out_error(path_errors[0])), _number(held_out_error(path_errors[-1]))
    titles = {e.name: e.title.lower() for e in found.path.last.model.effects}
    named = " and ".join(f"{titles[n]} ({n})" for n in found.missing)
    if found.verdict == "adequate":
        return f"Nothing in the residual is more than noise and known uncertainty (error {after} times the noise)."
    if found.verdict == "inconclusive":
        blind = sum(not d.typical for d in found.detectable)
        of = f"{blind} of {len(found.detectable)} effects would not have shown at a typical size"
        why = (
            "what the recordings say does not fit together"
            if blind <= MAX_UNDETECTABLE_SHARE * len(found.detectable)
            else of
        )
        return f"Nothing can be said: {why} (error {after} times the noise)."
    if found.verdict == "missing-effect":
        what = "it" if len(found.missing) == 1 else "them"
        text = f"The model lacks {named}: with {what} the error goes from {before} to {after} times the noise."
        equals = sorted({e for n in found.missing for e in found.equivalents[n]})
        return text + (f" These recordings cannot tell it from {', '.join(equals)}." if equals else "")
    assert unexplained is not None
    text = f"What remains is {discrepancy_character(unexplained)}; no effect of the catalogue accounts for it: {discrepancy_location(unexplained)}."
    return text + (f" Beside it stands what helped: {named}." if named else "")


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.3g}"
