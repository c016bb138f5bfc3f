"""Write the checks as JUnit XML, for continuous integration."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

from pneucli.report.report_data import Check


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
