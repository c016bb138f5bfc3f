"""Grading answers: how often the hidden effect was named, nothing was named where nothing was, and how exactly."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from pneucli.errors import InputError
from pneucli.exam.cases import SEALED

TOLERANCE = 0.15
SECONDS = "seconds.json"


@dataclass(frozen=True)
class Graded:
    """One case: what was hidden, and what was answered (the object of ``diagnose --json``)."""

    case: str
    truth: dict[str, Any]
    answer: dict[str, Any]

    @property
    def hidden(self) -> set[str]:
        """The true effects of the catalogue."""
        return set(self.truth["hidden"])

    @property
    def missing(self) -> set[str]:
        """The effects that the answer names."""
        return set(self.answer["missing"])

    @property
    def candidates(self) -> dict[str, dict[str, Any]]:
        """The candidates that the answer names, by effect."""
        return {c["effect"]: c for c in self.answer.get("candidates", []) if c["effect"] in self.missing}

    @property
    def covered(self) -> set[str]:
        """All effects in the answer: named, or stated not to be told apart from a named one."""
        return self.missing.union(*(c.get("indistinguishable_from", []) for c in self.candidates.values()))

    @property
    def kind_of_truth(self) -> str:
        """The row of the confusion matrix."""
        return self.truth["outside_the_catalogue"] or " + ".join(sorted(self.hidden)) or "none"

    @property
    def said(self) -> str:
        """The column of the confusion matrix."""
        names = " + ".join(sorted(self.missing))
        return (
            f"{names} (unexplained)"
            if names and self.answer["verdict"] == "unexplained"
            else names or self.answer["verdict"]
        )

    @property
    def parameters_right(self) -> list[bool]:
        """For every parameter of a true effect that was named: whether it is within 15 % of the truth."""
        return [
            abs(self.candidates[effect]["parameters"][name]["value"] - value) <= TOLERANCE * abs(value)
            for effect in self.hidden & set(self.candidates)
            for name, value in self.truth["hidden"][effect].items()
            if name in self.candidates[effect]["parameters"]
        ]

    @property
    def error_after(self) -> float | None:
        """Error of the last rung of the ladder, in units of the noise floor."""
        if not self.answer.get("ladder"):
            return None
        rung = self.answer["ladder"][-1]
        error = rung["error_test"] if rung["error_test"] is not None else rung["error_train"]
        return None if error is None else float(error)


def grade(directory: Path, answers: Path) -> dict[str, Any]:
    """Grade ``answers/CASE.json`` against the sealed truths (or ``CASE/truth.json``) below ``directory``.

    A share comes as right, of, share and its exact 95 % interval (Clopper and Pearson); a case without an answer is
    listed and counts as wrong. Raises InputError where there is no truth or an answer cannot be read.
    """
    truths = _truths(directory)
    graded = [Graded(case, truth, _answer(answers / f"{case}.json")) for case, truth in truths.items()]
    known = [g for g in graded if g.hidden]
    nulls = [g for g in graded if g.truth["verdict"] == "adequate"]
    strangers = [g for g in graded if g.truth["outside_the_catalogue"]]
    right = [right for g in known for right in g.parameters_right]
    errors = [g.error_after for g in known if g.hidden == g.missing and g.error_after is not None]
    return {
        "schema": "pneucli/exam/1",
        "cases": len(graded),
        "unanswered": [g.case for g in graded if g.answer["verdict"] == "no answer"],
        "shares": {
            "verdict right": _share(graded, lambda g: g.answer["verdict"] == g.truth["verdict"]),
            "true effects in the answer": _share(known, lambda g: g.hidden <= g.covered),
            "exactly the true effects": _share(known, lambda g: g.hidden == g.missing),
            "nulls named nothing": _share(nulls, lambda g: g.answer["verdict"] == "adequate" and not g.missing),
            "unknown flagged": _share(strangers, lambda g: g.answer["verdict"] == "unexplained"),
            "unknown wrongly named": _share(strangers, lambda g: bool(g.missing)),
            "parameters within 15 %": _proportion(sum(right), len(right)),
        },
        "error_after": {"median": float(np.median(errors)), "largest": max(errors)} if errors else None,
        "seconds": _seconds(answers / SECONDS),
        "confusion": _confusion(graded),
    }


def to_markdown(result: dict[str, Any]) -> str:
    """The grades and the confusion matrix as two Markdown tables."""
    lines = [f"{result['cases']} cases, {len(result['unanswered'])} without an answer", ""]
    lines += ["| what | right | of | share | 95 % interval |", "| --- | ---: | ---: | ---: | --- |"]
    for what, share in result["shares"].items():
        if share["of"]:
            low, high = share["ci95"]
            lines.append(
                f"| {what} | {share['right']} | {share['of']} | {share['share']:.0%} | {low:.0%} to {high:.0%} |"
            )
    if result["error_after"]:
        errors = result["error_after"]
        lines += [
            "",
            f"Error after, over the noise floor: {errors['median']:.2f} (median), {errors['largest']:.2f} (largest)",
        ]
    if result["seconds"]:
        taken = result["seconds"]
        lines += [
            "",
            f"Seconds a case: {taken['median']:.0f} (median), {taken['slowest']:.0f} ({taken['case']}, slowest)",
        ]
    lines += ["", "| hidden | answered | cases |", "| --- | --- | ---: |"]
    lines += [f"| {row['hidden']} | {row['answered']} | {row['cases']} |" for row in result["confusion"]]
    return "\n".join(lines) + "\n"


def _truths(directory: Path) -> dict[str, dict[str, Any]]:
    files = {path.stem: path for path in sorted((directory / SEALED).glob("*.json"))}
    files = files or {path.parent.name: path for path in sorted(directory.glob("*/truth.json"))}
    if not files:
        raise InputError(
            str(directory), "no sealed truths", "the folder that pneucli exam wrote", "write an exam first"
        )
    return {case: json.loads(path.read_text(encoding="utf-8")) for case, path in files.items()}


def _answer(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {"verdict": "no answer", "missing": []}
    try:
        answer = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise InputError(f"{path}, line {error.lineno}", "not JSON", "what pneucli diagnose --json prints") from error
    if not isinstance(answer, dict) or not {"verdict", "missing"} <= set(answer):
        raise InputError(str(path), "no verdict or no missing in it", "what pneucli diagnose --json prints")
    return answer


def _seconds(path: Path) -> dict[str, Any] | None:
    """Return the median and the slowest of the seconds by case, None where nobody noted them."""
    seconds: dict[str, float] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if not seconds:
        return None
    slowest = max(seconds, key=seconds.__getitem__)
    return {"median": float(np.median(list(seconds.values()))), "slowest": seconds[slowest], "case": slowest}


def _share(cases: Sequence[Graded], is_right: Callable[[Graded], bool]) -> dict[str, Any]:
    return _proportion(sum(is_right(case) for case in cases), len(cases))


def _proportion(right: int, of: int) -> dict[str, Any]:
    if not of:
        return {"right": 0, "of": 0, "share": None, "ci95": None}
    interval = binomtest(right, of).proportion_ci(0.95, method="exact")
    return {"right": right, "of": of, "share": right / of, "ci95": [float(interval.low), float(interval.high)]}


def _confusion(graded: Sequence[Graded]) -> list[dict[str, Any]]:
    counts = Counter((g.kind_of_truth, g.said) for g in graded)
    return [{"hidden": hidden, "answered": said, "cases": n} for (hidden, said), n in sorted(counts.items())]
