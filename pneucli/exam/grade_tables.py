"""Format the grades of an exam as Markdown for people, and as rows of tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pneucli.exam import reliability
from pneucli.exam.graded_case import GradedCase

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


def to_markdown(result: dict[str, Any]) -> str:
    """Return the grades, also by condition, the failures by cause and the confusion matrix as Markdown tables."""
    lines = [f"{result['cases']} cases, {len(result['unanswered'])} without an answer", "", *_seed_origin(result)]
    lines += ["| what | right | of | share | 95 % interval |", "| --- | ---: | ---: | ---: | --- |"]
    for what, share in result["shares"].items():
        if share["of"]:
            low, high = share["ci95"]
            lines.append(
                f"| {what} | {share['right']} | {share['of']} | {share['share']:.0%} | {low:.0%} to {high:.0%} |"
            )
    lines += [
        *_sizes(result),
        *reliability.reliability_table(result["calibration"]),
        *_conditions(result["conditions"]),
        *_failures(result),
    ]
    lines += ["", "| hidden | answered | cases |", "| --- | --- | ---: |"]
    lines += [f"| {row['hidden']} | {row['answered']} | {row['cases']} |" for row in result["confusion"]]
    return "\n".join(lines) + "\n"


def measure_rows(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return a row for each condition (``all``: the whole exam) and measure: value, counts, interval and unit."""
    table = []
    for group in [{"condition": "all", **result}, *result["conditions"]]:
        for what, share in group["shares"].items():
            low, high = share["ci95"] or (None, None)
            counts = {"right": share["right"], "of": share["of"], "ci_low": low, "ci_high": high}
            table.append(_row(group, what, share["share"], "1", **counts))
        for what, key, unit in (
            ("set size", "set_size", "1"),
            ("error after", "error_after", "1"),
            ("processor time", "seconds", "s"),
        ):
            for kind in ("median", "slowest" if key == "seconds" else "largest"):
                value = group[key][kind] if group[key] else None
                table.append(_row(group, f"{what}, {kind}", value, unit, of=group["cases"]))
        for cause, count in group["failures"].items():
            table.append(_row(group, f"failure: {cause}", float(count), "1", right=count, of=group["cases"]))
    return table


def case_rows(graded: Sequence[GradedCase]) -> list[dict[str, Any]]:
    """Return one row for each case."""
    return [
        {
            "case": g.case,
            "conditions": "+".join(g.truth.get("conditions", g.conditions)),
            "hidden": g.truth_label,
            "verdict": g.verdict,
            "named": " + ".join(sorted(g.missing)),
            "failure": g.failure_cause or "",
            "largest_set": float(max(g.set_sizes, default=0)),
            "error_after": g.final_error,
            "seconds": g.seconds,
        }
        for g in graded
    ]


def _row(
    group: dict[str, Any],
    what: str,
    value: float | None,
    unit: str,
    *,
    right: int | None = None,
    of: int = 0,
    ci_low: float | None = None,
    ci_high: float | None = None,
) -> dict[str, Any]:
    about = {"condition": group["condition"], "what": what, "value": value, "unit": unit}
    return about | {"right": right, "of": of, "ci_low": ci_low, "ci_high": ci_high}


def _seed_origin(result: dict[str, Any]) -> list[str]:
    """Say where the seed came from, so whether anybody could have tuned the program to the cases."""
    about = result["exam"]
    if about is None:
        return []
    if about["seed_from"] == "given":
        origin = "chosen by who wrote the exam."
    elif result["answered_by"] in ([], [about["program"]]):
        origin = "from the hash of the program that answers: nobody can have looked."
    else:
        origin = "from the hash of another program than the one that answered: the cases may have been seen."
    return [f"Seed {about['seed']}, {origin} Program: {about.get('program', 'not stated')}", ""]


def _sizes(result: dict[str, Any]) -> list[str]:
    lines = []
    if sizes := result["set_size"]:
        median, largest = sizes["median"], sizes["largest"]
        lines.append(
            f"Effects in one answer that it does not tell apart: {median:.0f} (median), {largest:.0f} (largest)"
        )
    if errors := result["error_after"]:
        median, largest = errors["median"], errors["largest"]
        lines.append(f"Error after, over the noise floor: {median:.2f} (median), {largest:.2f} (largest)")
    if taken := result["seconds"]:
        median, slowest = taken["median"], taken["slowest"]
        lines.append(f"Processor seconds a case: {median:.0f} (median), {slowest:.0f} ({taken['case']}, slowest)")
    return [text for line in lines for text in ("", line)]


def _conditions(groups: Sequence[dict[str, Any]]) -> list[str]:
    """Return a row for each condition; shares as right/of."""
    head = ["condition", "cases", *SHORT_TITLES.values(), "set", "error", "seconds"]
    lines = ["", "| " + " | ".join(head) + " |", "| --- |" + " ---: |" * (len(head) - 1)]
    for group in groups:
        shares = [group["shares"][what] for what in SHORT_TITLES]
        cells = [group["condition"], str(group["cases"])]
        cells += [f"{share['right']}/{share['of']}" if share["of"] else "" for share in shares]
        cells += [f"{group['set_size']['median']:.0f}" if group["set_size"] else ""]
        cells += [f"{group['error_after']['median']:.2f}" if group["error_after"] else ""]
        cells += [f"{group['seconds']['median']:.0f}" if group["seconds"] else ""]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _failures(result: dict[str, Any]) -> list[str]:
    """Count the failures by cause and condition."""
    if not result["failures"]:
        return []
    lines = ["", "| failure | cases | under |", "| --- | ---: | --- |"]
    for cause, count in sorted(result["failures"].items(), key=lambda pair: -pair[1]):
        under = [f"{g['condition']} {g['failures'][cause]}" for g in result["conditions"] if cause in g["failures"]]
        lines.append(f"| {cause} | {count} | {', '.join(under)} |")
    return lines
