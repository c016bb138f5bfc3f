"""Write a summary as Markdown for a pull request or a mail, with the numbers of the JSON answers, SI."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any
from xml.etree import ElementTree

from pneucli.messages import compare, diagnose
from pneucli.messages.compare import describe_event, test_first
from pneucli.messages.formatting import (
    format_fit,
    format_interval,
    format_noise_ratio,
    format_number,
    format_plain,
    format_quantity,
)
from pneucli.messages.history import models_on_current_data
from pneucli.report.overview import Overview, overview
from pneucli.report.report_data import Check, ReportData

Row = Sequence[object]


def to_markdown(material: ReportData, first: Overview | None = None) -> str:
    """Return overview, history, checks, errors and their location, selection path, parameters and warnings.

    Args:
        material: What is reported.
        first: The overview of it, where the page has it already.
    """
    return "\n".join(_lines(material, first or overview(material))) + "\n"


def _lines(material: ReportData, first: Overview) -> Iterator[str]:
    yield f"# {material.name}"
    yield from (line for text in _overview_lines(first) for line in ("", text))
    if len(material.history) > 1:
        rows = [
            (
                m.when,
                ", ".join(m.effects) or "base model",
                _number(m.error["test"]),
                _number(m.error["train"]),
            )
            for m in models_on_current_data(material.history)
        ]
        yield from _table("History, error over noise", ("compared", "effects", "test", "train"), rows)
    if material.checks:
        checks = [(c.path, c.wanted, _number(c.value), "FAILED" if c.failure else "passed") for c in material.checks]
        yield from _table("Checks", ("check", "wanted", "found", ""), checks)
    yield from _comparison(material.read(compare.Answer))
    if ladder := material.read(diagnose.Answer).ladder:
        steps = [(s.add or "model as given", _number(s.error_train), _number(s.error_test)) for s in ladder]
        yield from _table("Selection path, error over noise", ("add", "train", "test"), steps)
    if parameters := material.answer("identify").get("model", {}).get("parameters"):
        estimates = [(n, format_interval(p["value"], p["unit"], p["ci95"])) for n, p in parameters.items()]
        yield from _table("Parameters", ("name", "value, 95 % interval"), estimates)
    warnings = [f"{stage}: {w}" for stage, answer in material.answers.items() for w in answer.get("warnings", [])]
    if warnings:
        yield from ("", "## Warnings", "", *(f"- {warning}" for warning in warnings))


def _overview_lines(first: Overview) -> Iterator[str]:
    yield first.line
    yield from (f"**{tile.title}: {tile.large}** {tile.text}" for tile in first.tiles)
    yield from filter(None, (first.doubt, first.checks, first.failed, first.following))


def _comparison(answer: compare.Answer) -> Iterator[str]:
    if not answer.channels:
        return
    head = ("recording", "use", "channel", "rms error", "of range", "fit", "noise", "× noise")
    yield from _table("Model against measurement", head, [_channel(c) for c in test_first(answer.channels)])
    if answer.where:
        yield from (
            "",
            "## Where the error concentrates, worst first",
            "",
            *(f"- {describe_event(e)}" for e in answer.events[:10]),
        )


def _channel(c: compare.ChannelResult) -> Row:
    share = "–" if math.isnan(c.percent) else f"{format_number(c.percent, 3)} %"
    rmsd, noise = (format_quantity(size, c.unit, 3) for size in (c.rmsd, c.noise))
    ratio = format_noise_ratio(c.ratio_to_noise)
    return c.recording, c.use, c.channel, rmsd, share, format_fit(c.fit_percent), noise, ratio


def _table(title: str, head: Sequence[str], rows: Sequence[Row]) -> Iterator[str]:
    yield from ("", f"## {title}", "", _row(head), _row(["---"] * len(head)), *map(_row, rows))


def _row(cells: Row) -> str:
    return f"| {' | '.join(str(cell).replace('|', chr(92) + '|') for cell in cells)} |"


def _number(value: Any) -> str:
    if value is None:
        return "–"
    return format_plain(value, 4) if isinstance(value, float) else str(value)


def to_junit(name: str, checks: Sequence[Check]) -> str:
    """Return a test case for each check; a failure's text states value and limit, a skipped case its reason.

    The stage of a check (``compare`` of ``compare.error.test``) is the class name of its test case.
    """
    failures = sum(bool(check.failure) for check in checks)
    skipped = sum(bool(check.skipped) for check in checks)
    counts = {"tests": str(len(checks)), "failures": str(failures), "errors": "0", "skipped": str(skipped)}
    suites = ElementTree.Element("testsuites", counts)
    suite = ElementTree.SubElement(suites, "testsuite", {"name": f"pneucli {name}", **counts})
    for check in checks:
        stage = check.path.split(".")[0]
        case = ElementTree.SubElement(suite, "testcase", {"classname": f"{name}.{stage}", "name": check.path})
        if check.failure:
            ElementTree.SubElement(case, "failure", {"message": check.failure}).text = check.failure
        if check.skipped:
            ElementTree.SubElement(case, "skipped", {"message": check.skipped})
        ElementTree.SubElement(case, "system-out").text = f"{check.path} = {check.value} (wanted: {check.wanted})"
    ElementTree.indent(suites)
    return ElementTree.tostring(suites, encoding="unicode", xml_declaration=True) + "\n"
