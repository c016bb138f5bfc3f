"""Write a summary as Markdown for a pull request or a mail, with the tables of the terminal."""

from collections.abc import Iterator, Sequence
from xml.etree import ElementTree

from pneucli.messages import compare, diagnose, identify
from pneucli.messages.compare import describe_event, test_first
from pneucli.messages.formatting import format_figure
from pneucli.messages.history import MODEL_TITLES, models_on_current_data
from pneucli.report.overview import Overview, overview
from pneucli.report.report_data import CHECK_TITLES, Check, ReportData

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
        rows = [m.row for m in models_on_current_data(material.history)]
        yield from _table("History, error over noise", MODEL_TITLES, rows)
    if material.checks:
        yield from _table("Checks", CHECK_TITLES, [check.row for check in material.checks])
    yield from _comparison(material.read(compare.Answer))
    if ladder := material.read(diagnose.Answer).ladder:
        yield from _table("Selection path", diagnose.PATH_TITLES, [step.row for step in ladder])
    if parameters := material.read(identify.Answer).model.parameters:
        estimates = [(name, format_figure(one)) for name, one in parameters.items()]
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
    yield from _table("Model against measurement", compare.CHANNEL_TITLES, [c.row for c in test_first(answer.channels)])
    if answer.where:
        yield from (
            "",
            "## Where the error concentrates, worst first",
            "",
            *(f"- {describe_event(e)}" for e in answer.events[:10]),
        )


def _table(title: str, head: Sequence[str], rows: Sequence[Row]) -> Iterator[str]:
    yield from ("", f"## {title}", "", _row(head), _row(["---"] * len(head)), *map(_row, rows))


def _row(cells: Row) -> str:
    return f"| {' | '.join(str(cell).replace('|', chr(92) + '|') for cell in cells)} |"


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
