"""The pages as stored: of a whole bench, of one whose model was mended, of the thesis, and of what is rarer."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneucli import messages
from pneucli.figure import read
from pneucli.messages.diagnose import Answer
from pneucli.report.overview import overview
from pneucli.report.page import build_sections
from pneucli.report.page_elements import SectionMaker
from pneucli.report.report_data import EarlierAnswer, ReportData, Table
from pneucli.report.sections import (
    SECTIONS,
    closed_loop,
    comparison,
    correlations,
    diagnosis,
    error_location,
    law_comparison,
    valve,
)
from pneucli.report.summaries import to_markdown
from pneucli.report.thesis import SECTIONS as THESIS
from tests.report import thesis_tables
from tests.report.bench import answer, fallen, whole, without
from tests.report.printed import overview_lines, section_lines
from tests.stored import hold_against

FINDING = {"check": "silent", "signal": "p1", "recording": "axis_1", "found": "p1 stays", "mend": "check it"}
STORED = Path(__file__).with_name("stored")


def doubtful() -> ReportData:
    """Two doubts about the recordings, an earlier diagnosis with its probability, errors of fitted recordings only."""
    found = fallen()
    findings = [FINDING | {"weight": "doubt", "signal": signal} for signal in ("p1", "p2")]
    compared = found.answers["compare"] | {"error": {"train": 1.0, "test": None}}
    answers = {"ingest": found.answers["ingest"] | {"plausibility": findings}, "compare": compared}
    candidate = {"effect": "piston-leak", "confidence": 0.97}
    earlier = [EarlierAnswer(read(Answer, {"candidates": [candidate], "missing": ["piston-leak"]}))]
    return replace(found, answers=found.answers | answers, diagnoses=earlier)


def contradicted() -> ReportData:
    """Recordings that contradict the rig, which are told once."""
    found = whole()
    told = {"impossible": ["axis_1, p1 stays; check it"], "sentence": "axis_1, p1 stays. Nothing was looked for."}
    told |= {"verdict": "inconclusive", "missing": [], "next_experiment": None}
    ingest = found.answers["ingest"] | {"plausibility": [FINDING | {"weight": "contradiction"}]}
    return replace(found, answers=found.answers | {"ingest": ingest, "diagnose": found.answers["diagnose"] | told})


def two_chambers() -> ReportData:
    """The valve's tables for each of two chambers."""
    found, tables = whole(), {}
    for name in ("map", "inverse", "lack_of_fit", "areas", "curves"):
        one = found.tables[f"identify/valve_{name}"]
        twice = {key: np.concatenate([one[key], one[key]]) for key in one.columns}
        tables[f"identify/valve_{name}"] = Table({"chamber": np.repeat([1, 2], len(one)), **twice}, one.units)
    identify = found.answers["identify"]
    answers = found.answers | {"identify": identify | {"valve_2": identify["valve"]}}
    return replace(found, answers=answers, tables={**found.tables, **tables})


def on_an_ensemble() -> ReportData:
    """A design whose gains hold on an ensemble of rigs."""
    return ReportData("demo", {"design": answer("design") | {"ensemble": answer("ensemble")}})


def missed() -> ReportData:
    """A controller that misses its tolerance, and a residual without a significant correlation with the inputs."""
    found = whole()
    loop = found.answers["simulate"]
    loop = loop | {"closed_loop": loop["closed_loop"] | {"steps": {"steady_um": 99.0}}, "robust": {}}
    table = found.tables["compare/correlation"]
    faint = Table({**table.columns, "correlation": 0.3 * table["correlation"]})
    tables = {**found.tables, "compare/correlation": faint}
    return replace(found, answers=found.answers | {"simulate": loop}, tables=tables)


def only(*modules: object) -> tuple[SectionMaker, ...]:
    return tuple(module.section for module in modules)  # type: ignore[attr-defined]


PAGES: dict[str, tuple[Callable[[], ReportData], tuple[SectionMaker, ...]]] = {
    "whole": (whole, SECTIONS),
    "fallen": (fallen, only(error_location, diagnosis, comparison)),
    "doubtful": (doubtful, only(comparison)),
    "contradicted": (contradicted, only(diagnosis)),
    "two chambers": (two_chambers, only(valve)),
    "ensemble": (on_an_ensemble, only(law_comparison)),
    "missed": (missed, only(correlations)),
    "design alone": (lambda: without(whole(), "simulate", "diagnose"), only(closed_loop)),
    "thesis": (thesis_tables.material, THESIS),
    "thesis without a volume": (thesis_tables.without_volume, THESIS),
}


def lines(material: ReportData, makers: tuple[SectionMaker, ...]) -> Iterator[str]:
    yield from overview_lines(overview(material))
    for section in build_sections(material, makers):
        yield from section_lines(section)


@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_as_stored(name: str) -> None:
    material, makers = PAGES[name]
    hold_against(STORED / f"{name}.txt", "\n".join(lines(material(), makers)) + "\n")


def test_the_summary_is_as_stored(material: ReportData) -> None:
    hold_against(STORED / "summary.md", to_markdown(material))


@pytest.mark.parametrize("command", ["ingest", "compare", "diagnose", "design", "simulate"])
def test_the_terminal_says_of_the_same_answer_what_is_stored(material: ReportData, command: str) -> None:
    told = messages.render(command, material.answers[command], "axis.toml", verbose=True)
    hold_against(STORED / f"{command} on the terminal.txt", told + "\n")


def test_of_nothing_there_is_no_thesis() -> None:
    assert build_sections(ReportData("none"), THESIS) == []
