"""How a new answer differs from the stored one, for better or worse, and where answers contradict each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from benchmarks.truths import Truth, is_fault, is_refused, judged, reading_faults

ERROR_TOLERANCE, LEAST_CHANGE = 0.05, 0.02  # of an error over noise: of its size, and absolute
ROUNDING = 1e-3  # of kept numbers
GOOD = ("found", "right", "silent", "close", "covered")  # counts of which more is better
BAD = ("false",)  # counts of which fewer are better
NEITHER = ("exact", "mild")  # a mild name, or an equivalent one in place of the hidden one
Row = Mapping[str, Any]
Rows = Mapping[str, Row]  # of a case, by command


@dataclass(frozen=True)
class Change:
    """One difference between a stored answer and a new one; ``worse`` is None where nobody can tell."""

    command: str
    worse: bool | None
    text: str


def contradictions(rows: Rows) -> list[str]:
    """Return in which ways the answers to a case contradict each other or themselves, in words.

    One judgement decides: the error stands within its limit or not. Verdict, missing effects, test of the lack of fit,
    next command and tiles have to agree with it, an added effect may not raise the error, and two commands print one
    number.
    """
    compare, diagnose, report = (rows.get(name, {}) for name in ("compare", "diagnose", "report"))
    out = []
    adequate = diagnose.get("verdict") == "adequate"
    within = is_within_limit(compare)
    path = [judging(pair) for pair in diagnose.get("path", [])]
    own_limit = judging(diagnose.get("limit", (None, None)))
    if adequate and diagnose["missing"]:
        out.append("adequate, and effects are missing")
    if adequate and diagnose.get("lack_of_fit"):
        out.append("adequate, and a lack of fit is present")
    if adequate and (within is False or (path and exceeds(path[-1], own_limit))):
        out.append("adequate, and the error is beyond its limit")
    if adequate and diagnose.get("do") == "diagnose":
        out.append("adequate, and proposes to diagnose")
    if diagnose.get("verdict") == "missing-effect" and not diagnose["missing"]:
        out.append("an effect is missing, and none is named")
    if diagnose.get("verdict") == "missing-effect" and diagnose.get("lack_of_fit"):
        out.append("an effect is all that is missing, and a lack of fit is present")
    if diagnose.get("verdict") == "unexplained" and diagnose.get("lack_of_fit") is False:
        out.append("something is unexplained, and no lack of fit is present")
    if within and compare.get("do") == "diagnose":
        out.append("compare stands within the limit, and proposes to diagnose")
    if any(b > a * (1 + ERROR_TOLERANCE) for a, b in pairwise(path) if a is not None and b is not None):
        out.append("an added effect raises the error")
    if within is not None and path and differs(judging(compare["error"]), path[0]):  # a flow bench has two models
        out.append("compare and diagnose print two errors of one model")
    if "tiles" in report and within is not None and (report["tiles"].get("The model") == "good") != within:
        out.append("the tile of the model does not say what its limit says")
    return out


def judging(pair: Sequence[float | None]) -> float | None:
    """Return the error that judges a model: of test recordings, or of those that were fitted where there are none."""
    train, test = pair
    return train if test is None else test


def exceeds(error: float | None, limit: float | None) -> bool:
    """Whether a printed error is beyond the limit that stands beside it, by more than rounding."""
    return error is not None and limit is not None and error > limit * (1 + ROUNDING)


def is_within_limit(compare: Row) -> bool | None:
    """Whether the answer judges its model to be right: nothing of it is beyond a limit; None where it does not say."""
    if "error" not in compare:
        return None
    error, limit = judging(compare["error"]), judging(compare["limit"])
    return None if error is None or limit is None else not exceeds(error, limit) and not compare.get("lack_of_fit")


def differs(a: float | None, b: float | None) -> bool:
    """Whether two errors differ by more than the tolerance."""
    if a is None or b is None:
        return a is not b
    return abs(a - b) > LEAST_CHANGE + ERROR_TOLERANCE * min(abs(a), abs(b))


def compared(truth: Truth, old: Rows, new: Rows, *, is_sound: bool) -> list[Change]:
    """Return the changes of a case from the stored rows to the new ones, by command.

    Args:
        truth: What is true of the case.
        old: The stored rows by command.
        new: The new rows by command.
        is_sound: Whether nothing is wrong with the recordings, so that every doubt is a false alarm.

    """
    if not old:
        return [Change(", ".join(new), None, "no answer is stored")]
    out = []
    for command in [*new, *(name for name in old if name not in new)]:
        before, after = old.get(command), new.get(command)
        if before is None or after is None:
            out.append(Change(command, None, "was not asked" if before is None else "is no longer asked"))
        else:
            out += _of_exit(truth, before, after)
            if is_answer(after) and command == "diagnose":
                out += _of_counts(truth, before, after)
            if is_answer(before) and is_answer(after):
                out += _of_answer(truth, before, after, is_sound=is_sound)
    return [*out, *_of_reading(truth, old, new), *_of_contradictions(old, new)]


def is_answer(row: Row) -> bool:
    """Whether a row holds an answer: neither a refusal nor a fault."""
    return not is_refused(row) and not is_fault(row)


def _of_exit(truth: Truth, before: Row, after: Row) -> Iterator[Change]:
    command = after["command"]
    if is_fault(before) != is_fault(after):
        yield Change(command, is_fault(after), f"exit {before['exit']} -> {after['exit']}")
    elif is_refused(before) != is_refused(after):
        reasons = ", ".join((after if is_refused(after) else before).get("refused", []))
        worse = None if truth.may_refuse else is_refused(after)
        yield Change(command, worse, f"{'refused' if is_refused(after) else 'no longer refused'} ({reasons})")
    elif before["exit"] != after["exit"] or before.get("refused") != after.get("refused"):
        text = f"exit {before['exit']} {before.get('refused')} -> {after['exit']} {after.get('refused')}"
        yield Change(command, None, text)


def _of_answer(truth: Truth, before: Row, after: Row, *, is_sound: bool) -> Iterator[Change]:
    command = after["command"]
    if command == "init":
        if before["edits"] != after["edits"]:
            worse = after["edits"] > before["edits"]
            yield Change(command, worse, f"lines to edit {before['edits']} -> {after['edits']}")
        if before["takes"] != after["takes"]:
            yield Change(command, None, f"takes {before['takes']} -> {after['takes']}")
    elif command == "ingest" and before["doubts"] != after["doubts"]:
        came, went = after["doubts"].keys() - before["doubts"].keys(), before["doubts"].keys() - after["doubts"].keys()
        worse = bool(came) if is_sound and (came or went) else None
        yield Change(command, worse, f"doubts {before['doubts'] or 'none'} -> {after['doubts'] or 'none'}")
    elif command == "identify":
        yield from _of_intervals(command, before["parameters"], after["parameters"])
    elif command == "compare":
        yield from _of_error(command, judging(before["error"]), judging(after["error"]), matters=not truth.hidden)
    elif command == "diagnose":
        if before["verdict"] != after["verdict"]:
            yield Change(command, None, f"{before['verdict']} -> {after['verdict']}")
        if set(before["missing"]) == set(after["missing"]):
            yield from _of_error(command, judging(before["path"][-1]), judging(after["path"][-1]), matters=True)
            yield from _of_intervals(command, before["parameters"], after["parameters"])
    if before.get("figures") != after.get("figures"):
        yield Change(command, None, f"{before.get('figures')} -> {after.get('figures')}")


def _of_counts(truth: Truth, before: Row, after: Row) -> Iterator[Change]:
    """Yield how the names of a diagnosis became better or worse; an answer that was refused had none."""
    was, now, out = judged(truth, before), judged(truth, after), []
    for name in (*GOOD, *BAD, *NEITHER):
        a, b = getattr(was, name), getattr(now, name)
        if a != b and (name not in ("close", "covered") or was.parameters == now.parameters):
            worse = None if name in NEITHER else (b < a) == (name in GOOD)
            out.append(Change("diagnose", worse, f"{name} {a} -> {b}{_names(before, after)}"))
    if not out and _names(before, after):
        out.append(Change("diagnose", None, f"names{_names(before, after)}"))
    yield from out


def _names(before: Row, after: Row) -> str:
    was, now = before.get("missing", []), after["missing"]
    return "" if set(was) == set(now) else f": {', '.join(was) or 'nothing'} -> {', '.join(now) or 'nothing'}"


def _of_error(command: str, before: float | None, after: float | None, *, matters: bool) -> Iterator[Change]:
    """Yield the change of an error; that of a model that lacks an effect does not matter."""
    if differs(before, after):
        worse = after > before if matters and before is not None and after is not None else None
        yield Change(command, worse, f"error {before} -> {after}")


def _of_intervals(command: str, before: Row, after: Row) -> Iterator[Change]:
    """Yield a change for each parameter whose new value is outside the stored interval and the other way round."""
    for name in before.keys() & after.keys():
        (a, low_a, high_a), (b, low_b, high_b) = before[name], after[name]
        if None in (a, low_a, high_a, b, low_b, high_b):
            continue
        if not low_a <= b <= high_a and not low_b <= a <= high_b and abs(a - b) > ERROR_TOLERANCE * abs(a):
            yield Change(command, None, f"{name} {a:g} -> {b:g}")


def _of_reading(truth: Truth, old: Rows, new: Rows) -> Iterator[Change]:
    was, now = reading_faults(truth, old), reading_faults(truth, new)
    if len(was) != len(now):
        yield Change("ingest", len(now) > len(was), f"read wrongly: {'; '.join(was) or '-'} -> {'; '.join(now) or '-'}")


def _of_contradictions(old: Rows, new: Rows) -> Iterator[Change]:
    was, now = contradictions(old), contradictions(new)
    yield from (Change("diagnose", True, f"contradiction: {one}") for one in now if one not in was)
    yield from (Change("diagnose", False, f"no longer a contradiction: {one}") for one in was if one not in now)
