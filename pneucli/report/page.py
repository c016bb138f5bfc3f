"""The page: one HTML file that needs no network."""

import base64
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from pneucli.report.overview import Overview, overview
from pneucli.report.page_elements import Panel, Section, SectionMaker, ZoomPlot
from pneucli.report.report_data import ReportData
from pneucli.report.sections import SECTIONS

STYLES = ("uPlot.min.css", "page.css")
SCRIPTS = ("uPlot.iife.min.js", "plots.js", "report.js")


def build_sections(material: ReportData, makers: Sequence[SectionMaker] = SECTIONS) -> list[Section]:
    """Return the sections of the page, or of another one; a section without its artifact is left out."""
    return [section for make in makers if (section := make(material)) is not None]


def to_html(material: ReportData, sections: Sequence[Section] | None = None, first: Overview | None = None) -> str:
    """Return the page with the given sections and the given overview, by default with all of the material."""
    sections = build_sections(material) if sections is None else sections
    return render_page(material.name, first or overview(material), sections, material.footer)


def thesis_page(material: ReportData, sections: Sequence[Section]) -> str:
    """Return the page of the thesis with the given sections; nothing but a sentence where there are none."""
    line = "" if sections else "Nothing is identified that the figures of the thesis could show."
    front = Overview(" · ".join(filter(None, (material.rig, line))), (), {}, "", (), "", "", "")
    return render_page(f"{material.name}: figures of the thesis", front, sections, material.footer)


def render_page(name: str, front: Overview, sections: Sequence[Section], about: Mapping[str, str]) -> str:
    """Return a page.

    Args:
        name: Title of the page.
        front: What stands above the chapters.
        sections: The chapters.
        about: Lines of the footer by title.
    """
    scripts = SCRIPTS if any(_zoom_plots(sections)) else ()
    content = {"name": name, "front": front, "sections": sections, "about": about, "plots": _plots(sections)}
    return render_template("pneucli.report", "page.html.j2", STYLES, scripts, content)


def render_template(
    package: str, template: str, styles: Sequence[str], scripts: Sequence[str], content: Mapping[str, Any]
) -> str:
    """Return a page that needs no network and runs no script but its own.

    Args:
        package: The package whose folder ``assets`` holds all files.
        template: The template, which has ``styles``, ``scripts`` and ``policy`` beside the content.
        styles: The style sheets.
        scripts: The scripts.
        content: What the page shows, by name.
    """
    environment = Environment(
        loader=PackageLoader(package, "assets"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["named"] = _with_label
    assets = files(package) / "assets"
    style, script = ([Markup((assets / one).read_text(encoding="utf-8")) for one in some] for some in (styles, scripts))
    return environment.get_template(template).render(content, styles=style, scripts=script, policy=_policy(script))


def as_data(content: Any) -> Markup:
    """Return JSON that is safe inside a script element."""
    return Markup(json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))


def _with_label(svg: str, caption: str) -> str:
    """Return a picture with a label for screen readers."""
    return svg.replace('role="img"', f'role="img" aria-label="{escape(caption)}"', 1)


def _policy(scripts: Sequence[str]) -> str:
    """Return the content security policy: this page's own scripts and pictures, nothing from anywhere else."""
    hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    allowed = " ".join(f"'sha256-{one}'" for one in hashes) or "'none'"
    own = f"img-src data:; style-src 'unsafe-inline'; script-src {allowed}"
    return f"default-src 'none'; {own}; base-uri 'none'; form-action 'none'"


def _zoom_plots(sections: Sequence[Section]) -> Iterator[ZoomPlot]:
    return (part for section in sections for part in section.parts if isinstance(part, ZoomPlot))


def _plots(sections: Sequence[Section]) -> Markup:
    """Return the data of the zoomable plots."""
    return as_data(
        {
            zoom.name: [{"name": r.name, "panels": [_panel(p) for p in r.panels]} for r in zoom.runs]
            for zoom in _zoom_plots(sections)
        }
    )


def _panel(panel: Panel) -> dict[str, Any]:
    start = float(panel.time[0]) if panel.time.size else 0.0
    return {
        "title": panel.title,
        "unit": panel.unit,
        "start": start,
        "restarts": [round(t, 6) for t in panel.restarts],
        "time": _base64_values(panel.time - start),
        "series": [{"label": s.label, "role": s.role, "values": _base64_values(s.values)} for s in panel.series],
    }


def _base64_values(values: Any) -> str:
    """Return values as little-endian single precision in base 64; NaN stays NaN."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")
