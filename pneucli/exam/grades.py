"""The answers of ``exam``: what was written, what was answered, and the grades."""

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from pneucli.errors import InputError
from pneucli.exam.cases import EXAM_FILE, SEALED_FOLDER
from pneucli.exam.graded_case import GradedCase
from pneucli.figure import optional

SHORT_TITLES = {
    "verdict right": "verdict",
    "true effects in the answer": "in the answer",
    "exactly the true effects": "exactly",
    "clean nulls named nothing": "clean nulls",
    "messy nulls named nothing": "messy nulls",
    "unknown flagged": "unknown",
    "parameters within 15 %": "parameters",
    "intervals that hold the truth": "intervals",
}
"""The shares that each condition has a column of."""


@dataclass(frozen=True)
class Written:
    """An exam that was written: the names of its cases, and what was asked for."""

    schema: str
    directory: str
    size: float
    seed: int
    seed_from: str
    program: str
    conditions: Sequence[str]
    cases: Sequence[str]


@dataclass(frozen=True)
class WrittenLike:
    """An exam that imitates the rig of a pipeline."""

    schema: str
    directory: str
    like: str
    seed: int
    sizes: Sequence[float]
    cases: Sequence[str]


@dataclass(frozen=True)
class Answered:
    """The cases that were answered, those that failed with their error, and the processor seconds of each."""

    schema: str
    answered: Sequence[str]
    failed: Mapping[str, str]
    seconds: Mapping[str, float]

    @property
    def text(self) -> str:
        """The failures, and how many cases were answered."""
        failed = [f"{case} failed: {error}" for case, error in self.failed.items()]
        return "\n".join([*failed, f"{len(self.answered)} cases answered, {len(failed)} failed"])


@dataclass(frozen=True)
class Share:
    """A share with its exact 95 % interval; None for both of no cases."""

    right: int
    of: int
    share: float | None
    ci95: Sequence[float] | None

    @property
    def counts(self) -> str:
        """Right of all; nothing of no cases."""
        return f"{self.right}/{self.of}" if self.of else ""


@dataclass(frozen=True)
class Bin:
    """Probabilities that were stated in a range: their mean, and how many of the effects were present."""

    from_: float
    to: float
    stated: float
    there: int
    of: int


@dataclass(frozen=True)
class Reliability:
    """Stated probabilities against the truth: by range, and by the Brier and the mean logarithmic score."""

    bins: Sequence[Bin]
    brier: float
    log: float
    of: int

    @property
    def table(self) -> list[str]:
        """The lines of a Markdown table."""
        return [
            *("", f"Probabilities: Brier score {self.brier:.3f}, log score {self.log:.3f}, of {self.of}"),
            *("", "| stated | mean | there | of |", "| --- | ---: | ---: | ---: |"),
            *(f"| {b.from_:g} to {b.to:g} | {b.stated:.2f} | {b.there} | {b.of} |" for b in self.bins),
        ]


@dataclass(frozen=True)
class Spread:
    """The median and the largest of some numbers."""

    median: float
    largest: float


@dataclass(frozen=True)
class RunTimes:
    """The median and the most processor seconds of a case, and the case that took most."""

    median: float
    slowest: float
    case: str


@dataclass(frozen=True)
class Counts:
    """What is counted of some cases: shares by what they count, failures by their cause."""

    cases: int
    unanswered: Sequence[str]
    shares: Mapping[str, Share]
    calibration: Reliability | None
    set_size: Spread | None
    error_after: Spread | None
    seconds: RunTimes | None
    failures: Mapping[str, int]

    def measures(self, condition: str) -> Iterator[dict[str, Any]]:
        """Yield a row for each measure: condition, value, counts, interval and unit."""

        def row(what: str, value: float | None, unit: str = "1", **counts: Any) -> dict[str, Any]:
            usual = {"right": None, "of": self.cases, "ci_low": None, "ci_high": None}
            return {"condition": condition, "what": what, "value": value, "unit": unit, **(usual | counts)}

        for what, one in self.shares.items():
            low, high = one.ci95 or (None, None)
            yield row(what, one.share, right=one.right, of=one.of, ci_low=low, ci_high=high)
        for what, spread in (("set size", self.set_size), ("error after", self.error_after)):
            yield row(f"{what}, median", spread.median if spread else None)
            yield row(f"{what}, largest", spread.largest if spread else None)
        taken = self.seconds
        yield row("processor time, median", taken.median if taken else None, "s")
        yield row("processor time, slowest", taken.slowest if taken else None, "s")
        for cause, count in self.failures.items():
            yield row(f"failure: {cause}", float(count), right=count)


@dataclass(frozen=True)
class _Named:
    condition: str


@dataclass(frozen=True)
class ConditionCounts(Counts, _Named):
    """The counts of the cases under one condition."""

    @property
    def row(self) -> str:
        """The row of a Markdown table."""
        cells = [self.condition, str(self.cases), *(self.shares[what].counts for what in SHORT_TITLES)]
        cells.append(f"{self.set_size.median:.0f}" if self.set_size else "")
        cells.append(f"{self.error_after.median:.2f}" if self.error_after else "")
        cells.append(f"{self.seconds.median:.0f}" if self.seconds else "")
        return f"| {' | '.join(cells)} |"


@dataclass(frozen=True)
class Confusion:
    """How often what was hidden was answered so."""

    hidden: str
    answered: str
    cases: int


@dataclass(frozen=True)
class OfSize:
    """The cases of an effect at one size over the usual: how often it was named, and what was named instead."""

    size: float
    cases: int
    named: int
    share: float
    ci95: Sequence[float]
    named_instead: Sequence[str]


@dataclass(frozen=True)
class EffectSizes:
    """An effect by its sizes; ``named_from`` is the smallest from which it is named in most cases."""

    effect: str
    sizes: Sequence[OfSize]
    named_from: float | None

    def row(self, sizes: Sequence[float]) -> str:
        """Return the row of a Markdown table with a column for each size."""
        cells = {one.size: f"{one.named} of {one.cases}" for one in self.sizes}
        others = sorted({name for one in self.sizes for name in one.named_instead})
        smallest = "never" if self.named_from is None else f"× {self.named_from:g}"
        return f"| {self.effect} | {smallest} | {' | '.join(cells.get(s, '') for s in sizes)} | {', '.join(others)} |"


@dataclass(frozen=True)
class Like:
    """What a bench can tell: effects by size, and false alarms."""

    schema: str
    effects: Sequence[EffectSizes]
    nulls: int
    false_alarms: int
    false_alarms_ci95: Sequence[float] | None
    like: str = ""

    def page(self, sizes: Sequence[float]) -> str:
        """Return a page of Markdown."""
        lines = [
            *("# What this bench can tell", ""),
            *("Sizes are in units of the usual (docs: exam). A cell: named, of cases.", ""),
            f"| effect | named from | {' | '.join(f'× {s:g}' for s in sizes)} | named instead |",
            "| --- | --- |" + " --- |" * (len(sizes) + 1),
            *(one.row(sizes) for one in self.effects),
            *("", f"Nothing hidden: {self.false_alarms} of {self.nulls} named something."),
        ]
        return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class _Head:
    exam: Mapping[str, Any] | None
    answered_by: Sequence[str]
    schema: str


@dataclass(frozen=True)
class Grades(Counts, _Head):
    """The grades of an exam: all cases, those of each condition, and what was answered for what was hidden."""

    conditions: Sequence[ConditionCounts]
    confusion: Sequence[Confusion]
    like: Like | None = optional()

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each condition (``all``: the whole exam) and measure."""
        return [*self.measures("all"), *(row for one in self.conditions for row in one.measures(one.condition))]

    @property
    def page(self) -> str:
        """The grades, also by condition, the failures by cause and the confusion matrix as Markdown tables."""
        lines = [f"{self.cases} cases, {len(self.unanswered)} without an answer", "", *self._seed_origin()]
        lines += ["| what | right | of | share | 95 % interval |", "| --- | ---: | ---: | ---: | --- |"]
        for what, one in self.shares.items():
            if one.ci95 is not None:
                low, high = one.ci95
                lines.append(f"| {what} | {one.right} | {one.of} | {one.share:.0%} | {low:.0%} to {high:.0%} |")
        lines += [*self._sizes(), *(self.calibration.table if self.calibration else ()), *self._by_condition()]
        lines += [*self._failures(), "", "| hidden | answered | cases |", "| --- | --- | ---: |"]
        lines += [f"| {one.hidden} | {one.answered} | {one.cases} |" for one in self.confusion]
        return "\n".join(lines) + "\n"

    def _seed_origin(self) -> list[str]:
        """Say where the seed came from, so whether anybody could have tuned the program to the cases."""
        if self.exam is None:
            return []
        if self.exam["seed_from"] == "given":
            origin = "chosen by who wrote the exam."
        elif self.answered_by in ([], [self.exam["program"]]):
            origin = "from the hash of the program that answers: nobody can have looked."
        else:
            origin = "from the hash of another program than the one that answered: the cases may have been seen."
        return [f"Seed {self.exam['seed']}, {origin} Program: {self.exam.get('program', 'not stated')}", ""]

    def _sizes(self) -> Iterator[str]:
        if one := self.set_size:
            alike = f"{one.median:.0f} (median), {one.largest:.0f} (largest)"
            yield from ("", f"Effects in one answer that it does not tell apart: {alike}")
        if one := self.error_after:
            yield from (
                "",
                f"Error after, over the noise floor: {one.median:.2f} (median), {one.largest:.2f} (largest)",
            )
        if taken := self.seconds:
            spent = f"{taken.median:.0f} (median), {taken.slowest:.0f} ({taken.case}, slowest)"
            yield from ("", f"Processor seconds a case: {spent}")

    def _by_condition(self) -> Iterator[str]:
        """Yield a row for each condition; shares as right/of."""
        head = ["condition", "cases", *SHORT_TITLES.values(), "set", "error", "seconds"]
        yield from ("", f"| {' | '.join(head)} |", "| --- |" + " ---: |" * (len(head) - 1))
        yield from (one.row for one in self.conditions)

    def _failures(self) -> Iterator[str]:
        """Yield the failures by cause and condition."""
        if self.failures:
            yield from ("", "| failure | cases | under |", "| --- | ---: | --- |")
        for cause, count in sorted(self.failures.items(), key=lambda pair: -pair[1]):
            under = [f"{one.condition} {one.failures[cause]}" for one in self.conditions if cause in one.failures]
            yield f"| {cause} | {count} | {', '.join(under)} |"


BIN_EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
MIN_PROBABILITY = 1e-3  # exams have some hundred cases: they cannot check a smaller one
SECONDS_FILE = "seconds.json"


def reliability(graded: Sequence[GradedCase]) -> Reliability | None:
    """Return a reliability table, the Brier score and the mean logarithmic score of all fitted effects.

    None where no answer states a probability.

    References:
        G. Brier, Mon. Weather Rev. 78 (1950) 1; I. Good, J. R. Stat. Soc. B 14 (1952) 107.

    """
    stated = [(min(max(p, 0.0), 1.0), true) for g in graded for p, true in g.stated_probabilities]
    if not stated:
        return None
    bins = []
    for low, high in pairwise(BIN_EDGES):
        in_bin = [(p, true) for p, true in stated if low <= p < high or p == high == 1.0]
        if in_bin:
            present = sum(true for _, true in in_bin)
            bins.append(Bin(low, high, _mean([p for p, _ in in_bin]), present, len(in_bin)))
    bounded = [(min(max(p, MIN_PROBABILITY), 1.0 - MIN_PROBABILITY), true) for p, true in stated]
    return Reliability(
        bins,
        brier=_mean([(p - true) ** 2 for p, true in stated]),
        log=_mean([-math.log(p if true else 1.0 - p) for p, true in bounded]),
        of=len(stated),
    )


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def grade(directory: Path, answers: Path) -> Grades:
    """Grade ``answers/CASE.json`` against the sealed truths (or ``CASE/truth.json``) below ``directory``.

    A share is given as right, of, share and its exact 95 % interval (Clopper and Pearson), for the exam and for each
    condition. A case without an answer is listed and counts as wrong. Raises InputError where there is no truth or an
    answer cannot be read.
    """
    graded = graded_cases(directory, answers)
    sealed = directory / SEALED_FOLDER / EXAM_FILE
    exam = json.loads(sealed.read_text(encoding="utf-8")) if sealed.exists() else None
    return report(graded, exam, sorted({str(g.answer["program"]) for g in graded if "program" in g.answer}))


def report(
    graded: Sequence[GradedCase], exam: Mapping[str, Any] | None = None, answered_by: Sequence[str] = ()
) -> Grades:
    """Count all cases and those of each condition, and make the confusion matrix."""
    groups = {name: [g for g in graded if name in g.conditions] for each in graded for name in each.conditions}
    return Grades(
        exam=exam,
        answered_by=answered_by,
        schema="pneucli/exam/1",
        **_counts(graded),
        conditions=[ConditionCounts(condition=name, **_counts(cases)) for name, cases in sorted(groups.items())],
        confusion=_confusion(graded),
    )


def graded_cases(directory: Path, answers: Path) -> list[GradedCase]:
    """All cases with their answers. Raises InputError as ``grade`` does."""
    seconds = answers / SECONDS_FILE
    taken: dict[str, float] = json.loads(seconds.read_text(encoding="utf-8")) if seconds.exists() else {}
    return [
        GradedCase(case, truth, _answer(answers / f"{case}.json"), taken.get(case))
        for case, truth in _truths(directory).items()
    ]


def _counts(graded: Sequence[GradedCase]) -> dict[str, Any]:
    with_effects = [g for g in graded if g.hidden]
    nulls = [g for g in graded if g.is_null]
    disturbed = [g for g in graded if g.uncatalogued_effect]
    accurate = [right for g in with_effects for right in g.parameters_within_tolerance]
    covered = [covers for g in with_effects for covers in g.intervals_cover_truth]
    stated = [right for g in graded for right in g.stated_within_tolerance]
    stated_covered = [covers for g in graded for covers in g.stated_intervals_cover_truth]
    without_area = [g for g in graded if not g.truth.get("command_sets_area", True)]
    confident_namings = [true for g in graded for true in g.confident_namings]
    confident_detections = [found for g in with_effects for found in g.confident_detections]
    return {
        "cases": len(graded),
        "unanswered": [g.case for g in graded if g.verdict == "no answer"],
        "shares": {
            "verdict right": _share_correct(graded, lambda g: g.verdict_is_correct),
            "true effects in the answer": _share_correct(with_effects, lambda g: g.hidden <= g.answer_set),
            "exactly the true effects": _share_correct(with_effects, lambda g: g.hidden == g.missing),
            "nulls named nothing": _share_correct(nulls, lambda g: g.is_correct_null),
            "clean nulls named nothing": _share_correct(
                [g for g in nulls if not g.has_small_effects], lambda g: g.is_correct_null
            ),
            "messy nulls named nothing": _share_correct(
                [g for g in nulls if g.has_small_effects], lambda g: g.is_correct_null
            ),
            "unknown flagged": _share_correct(disturbed, lambda g: g.verdict == "unexplained"),
            "unknown wrongly named": _share_correct(disturbed, lambda g: bool(g.missing)),
            "inconclusive": _share_correct(graded, lambda g: g.verdict == "inconclusive"),
            "parameters within 15 %": proportion(sum(accurate), len(accurate)),
            "intervals that hold the truth": proportion(sum(covered), len(covered)),
            "stated effects: parameters within 15 %": proportion(sum(stated), len(stated)),
            "stated effects: intervals that hold the truth": proportion(sum(stated_covered), len(stated_covered)),
            "told that the command sets no area": _share_correct(without_area, lambda g: g.is_source_recognised),
            "named with 0.9 or more, and true": proportion(sum(confident_namings), len(confident_namings)),
            "true effects named with 0.9 or more": proportion(sum(confident_detections), len(confident_detections)),
            "unknown flagged in its subsystem, over its signal": _share_correct(
                disturbed, lambda g: g.verdict_is_correct
            ),
        },
        "calibration": reliability(graded),
        "set_size": _summary([size for g in with_effects for size in g.set_sizes]),
        "error_after": _summary([g.final_error for g in with_effects if g.hidden == g.missing]),
        "seconds": _run_times(graded),
        "failures": dict(sorted(Counter(g.failure_cause for g in graded if g.failure_cause).items())),
    }


def _truths(directory: Path) -> dict[str, dict[str, Any]]:
    sealed = sorted((directory / SEALED_FOLDER).glob("*.json"))
    files = {path.stem: path for path in sealed if path.name != EXAM_FILE}
    files = files or {path.parent.name: path for path in sorted(directory.glob("*/truth.json"))}
    if not files:
        raise InputError(
            str(directory), "no sealed truths", "the folder that pneucli exam wrote", "write an exam first", code="E007"
        )
    return {case: json.loads(path.read_text(encoding="utf-8")) for case, path in files.items()}


def _answer(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {"verdict": "no answer", "missing": []}
    try:
        answer = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path}, line {error.lineno}", "not JSON", "what pneucli diagnose --json prints", code="E007"
        ) from error
    if not isinstance(answer, dict) or not {"verdict", "missing"} <= set(answer):
        raise InputError(
            str(path), "no verdict or no missing in it", "what pneucli diagnose --json prints", code="E007"
        )
    return answer


def _summary(values: Sequence[float | None]) -> Spread | None:
    there = [value for value in values if value is not None]
    return Spread(float(np.median(there)), float(max(there))) if there else None


def _run_times(graded: Sequence[GradedCase]) -> RunTimes | None:
    """Return the median and the maximum of the processor seconds; None where the answers have none."""
    noted = {g.case: g.seconds for g in graded if g.seconds is not None}
    if not noted:
        return None
    slowest = max(noted, key=noted.__getitem__)
    return RunTimes(float(np.median(list(noted.values()))), noted[slowest], slowest)


def _share_correct(cases: Sequence[GradedCase], is_right: Callable[[GradedCase], bool]) -> Share:
    return proportion(sum(is_right(case) for case in cases), len(cases))


def proportion(right: int, of: int) -> Share:
    """Return a share with its exact 95 % interval; None for both of no cases."""
    if not of:
        return Share(0, 0, None, None)
    interval = binomtest(right, of).proportion_ci(0.95, method="exact")
    return Share(right, of, right / of, [float(interval.low), float(interval.high)])


def _confusion(graded: Sequence[GradedCase]) -> list[Confusion]:
    counts = Counter((g.truth_label, g.answer_label) for g in graded)
    return [Confusion(hidden, label, n) for (hidden, label), n in sorted(counts.items())]
