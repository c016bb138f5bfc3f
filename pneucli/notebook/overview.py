"""What a run is, at a glance, for a notebook: read from the artifacts, without running anything."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pneucli.messages.compare import evaluation_error
from pneucli.messages.formatting import format_noise_ratio, join_names
from pneucli.pipeline.graph import STAGES
from pneucli.pipeline.manifest import read_manifest

Rows = Sequence[tuple[str, str]]
MAX_NAMES = 6  # recordings in the overview


def run_overview(artifacts: Path) -> list[tuple[str, str]]:
    """Return label and text of each line: model, error, verdict, recordings, finished stages, folder."""
    answers = _answers(artifacts)
    rows = [("folder", str(artifacts))]
    if "compare" in answers:
        compared = answers["compare"]
        use, error = evaluation_error(compared["error"])
        rows.append(("model", " + ".join(["base", *compared["model"]["effects"]])))
        rows.append(("error", f"{format_noise_ratio(error)} × noise on {use} recordings"))
    if "diagnose" in answers:
        rows.append(("verdict", answers["diagnose"].get("sentence", answers["diagnose"]["verdict"])))
    if "ingest" in answers:
        names = [one["name"] for one in answers["ingest"]["recordings"]]
        more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
        rows.append(("recordings", f"{len(names)}: {', '.join(names[:MAX_NAMES])}{more}"))
    rows.append(("stages", join_names(list(answers)) or "none has run"))
    return rows


def _answers(artifacts: Path) -> dict[str, dict[str, Any]]:
    manifests = {name: read_manifest(artifacts / name) for name in STAGES}
    return {name: dict(one.answer) for name, one in manifests.items() if one is not None and one.answer is not None}


def as_text(title: str, rows: Rows) -> str:
    """Return an overview as text."""
    width = max(len(label) for label, _ in rows)
    return "\n".join([title, *(f"  {label:<{width}}  {text}" for label, text in rows)])


def as_html(title: str, rows: Rows) -> str:
    """Return an overview as a table of HTML; names are escaped."""
    cell = '<td style="text-align:left">{}</td>'
    lines = (f"<tr>{cell.format(html.escape(a))}{cell.format(html.escape(b))}</tr>" for a, b in rows)
    return f"<strong>{html.escape(title)}</strong><table>{''.join(lines)}</table>"
