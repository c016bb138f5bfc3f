"""The page: one HTML file that needs no network."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from importlib.resources import files
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from pneucli.report.material import Material
from pneucli.report.parts import Note, Panel, Section, Zoom
from pneucli.report.sections import SECTIONS
from pneucli.report.sections.comparison import verdict as compared
from pneucli.report.sections.diagnosis import verdict as diagnosed

_ASSETS = files("pneucli.report") / "assets"


def to_html(material: Material) -> str:
    """Return the whole page; a section whose artifact is absent is absent."""
    environment = Environment(
        loader=PackageLoader("pneucli.report", "assets"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["asset"] = lambda name: Markup((_ASSETS / name).read_text(encoding="utf-8"))
    sections = [section for make in SECTIONS if (section := make(material)) is not None]
    return environment.get_template("page.html.j2").render(
        name=material.name,
        warnings=list(warnings(material)),
        verdicts=verdicts(material),
        sections=sections,
        about=material.about,
        plots=Markup(_plots(sections)),
    )


def verdicts(material: Material) -> list[Note]:
    """Return the sentences that stand first: the error against the noise floor, the diagnosis, failed checks."""
    notes = [compared(material.answer("compare")), diagnosed(material.answer("diagnose"))]
    if failed := [check.path for check in material.checks if check.failure]:
        notes.append(Note(f"Failed checks: {', '.join(failed)}.", "bad"))
    return [note for note in notes if note is not None]


def warnings(material: Material) -> Iterator[str]:
    """Yield every warning of every stage, and what a reader must know before the numbers."""
    for stage, answer in material.answers.items():
        yield from (f"{stage}: {warning}" for warning in answer.get("warnings", []))
    errors = material.answer("compare").get("error", {})
    if errors and errors.get("test") is None:
        yield "compare: no test recording; the errors are of recordings that the model was fitted to"


def _plots(sections: list[Section]) -> str:
    """Return the data of the zoomable plots as JSON that can stand in a script element."""
    zooms = [part for section in sections for part in section.parts if isinstance(part, Zoom)]
    content = {
        zoom.name: [{"name": r.name, "panels": [_panel(p) for p in r.panels]} for r in zoom.runs] for zoom in zooms
    }
    return json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")


def _panel(panel: Panel) -> dict[str, Any]:
    start = float(panel.time[0]) if panel.time.size else 0.0
    return {
        "title": panel.title,
        "unit": panel.unit,
        "start": start,
        "time": _packed(panel.time - start),
        "series": [{"label": s.label, "role": s.role, "values": _packed(s.values)} for s in panel.series],
    }


def _packed(values: Any) -> str:
    """Return values as little-endian single precision in base 64; NaN stays NaN."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")
