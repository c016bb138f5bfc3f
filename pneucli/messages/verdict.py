"""The verdict of a diagnosis with its warnings and detection limits, as sentences of the answer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from pneucli.messages.discrepancy import discrepancy_character, discrepancy_location
from pneucli.messages.formatting import join_names
from pneucli.units import unit_suffix

WARNINGS = {
    "cross-validated": 'no recording has use = "test": each is held out in turn, from a model fitted without it',
    "no-held-out": "no recording is held out: the findings rest on the fitted recordings alone",
    "subsampled": "{used} of {samples} samples are diagnosed: evenly spaced segments of the longest recordings",
    "p2-inferred": (
        "{recordings}: p2 was not recorded and is inferred from the model; its initial value can hide a force like "
        "that of a spring"
    ),
    "p2-missing": (
        "{recordings}: chamber 2 is shut or driven and p2 was not recorded: the forces on the piston cannot be "
        "distinguished; record p2"
    ),
    "within-uncertainty": (
        "{channel} of recordings that were not fitted errs by {ratio:.2g} times its noise, no more than the "
        "uncertainty of the fitted parameters allows (95 %): record such commands or speeds for the fit, too"
    ),
}


def warning_text(code: str, **values: Any) -> str:
    """Return a warning of a diagnosis by its code."""
    return WARNINGS[code].format(**values)


def verdict_explanation(
    verdict: str,
    named: Sequence[tuple[str, str]],
    errors: tuple[float | None, float | None],
    equivalents: Sequence[str] = (),
    undetectable: tuple[int, int] | None = None,
    unexplained: Mapping[str, Any] | None = None,
) -> str:
    """Return the verdict with its reason in one or two sentences.

    Args:
        verdict: As in the answer.
        named: Titles and names of the named effects.
        errors: Error of the given and of the last model in units of noise.
        equivalents: Names of the effects that are indistinguishable from the named ones.
        undetectable: Number of effects that are undetectable at a typical size, and of all, if the verdict is
            inconclusive.
        unexplained: The answer's entry about the unexplained residual.

    """
    before, after = (_format_error(error) for error in errors)
    effects = " and ".join(f"{title[:1].lower()}{title[1:]} ({name})" for title, name in named)
    if verdict == "adequate":
        return f"Nothing in the residual exceeds noise and parameter uncertainty (error {after} times the noise)."
    if verdict == "inconclusive":
        assert undetectable is not None
        why = f"{undetectable[0]} of {undetectable[1]} effects are undetectable at a typical size"
        return f"No statement is possible: {why} (error {after} times the noise)."
    if verdict == "missing-effect":
        pronoun = "it" if len(named) == 1 else "them"
        text = f"The model lacks {effects}: with {pronoun} the error goes from {before} to {after} times the noise."
        return text + (
            f" These recordings cannot distinguish it from {join_names(equivalents)}." if equivalents else ""
        )
    assert unexplained is not None
    text = (
        f"What remains is {discrepancy_character(unexplained)}; no effect of the catalogue explains it: "
        f"{discrepancy_location(unexplained)}."
    )
    return text + (f" These effects reduce the error: {effects}." if effects else "")


def impossible_data_sentence(findings: Sequence[str]) -> str:
    """Return why nothing was looked for: the first finding with its mend, and the number of others.

    Args:
        findings: Sentences of the findings, at least one.

    >>> print(impossible_data_sentence(["run_1, x moves at 112 m/s; check [signals] x", "run_1, p1 below vacuum"]))
    run_1, x moves at 112 m/s; check [signals] x (and 1 more). Such recordings cannot be true: no effect was looked for.
    """
    others = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
    return f"{findings[0]}{others}. Such recordings cannot be true: no effect was looked for."


def _format_error(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.3g}"


def detection_limit_sentence(
    title: str, parameter: str, size: float | None, unit: str, null: float | str | None, where: Sequence[str] = ()
) -> str:
    """Return from which size on an effect is detectable; None: at no plausible size.

    ``null`` is that of the parameter, at which the effect is absent; ``where`` has the values of parameters that say
    where, when or how fast the effect acts.
    """
    if size is None:
        return f"{title}: these recordings cannot detect it at any plausible size"
    limit = f"{size:.2g}{unit_suffix(unit)} ({'; '.join([parameter, *where])})"
    if null == 0.0:
        return f"{title}: detectable above {limit}"
    if null is None or null == math.inf:
        return f"{title}: detectable at {limit}"
    return f"{title}: detectable from a difference of {limit} on"


def location_phrase(parameter: str, value: float, unit: str) -> str:
    """Return the value of a parameter that says where, when or how fast an effect acts."""
    return f"{parameter} {value:.2g}{unit_suffix(unit)}"
