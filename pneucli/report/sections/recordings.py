"""The measurements: recordings, their signals, sensor noise, and repairs while reading."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath

from pneucli.messages.formatting import format_number, format_plain, format_quantity
from pneucli.messages.ingest import Answer, NoiseAnswer, Recording, Repair, implausibility_sentences
from pneucli.report.page_elements import MAX_UNFOLDED_ROWS, Grid, Note, Part, Row, Section, warning_notes
from pneucli.report.report_data import ReportData

PLACE = 140  # on the page


def section(material: ReportData) -> Section | None:
    """Return the recordings and repairs; absent where nothing was ingested."""
    if not material.answer("ingest"):
        return None
    answer = material.read(Answer)
    recordings = answer.recordings
    parts: list[Part] = [
        *(Note(f"{doubt}.", "warning") for doubt in implausibility_sentences(answer.plausibility)),
        *warning_notes(material, "ingest"),
        _recordings(recordings, material),
        _noise(recordings),
    ]
    if answer.repairs:
        parts.append(_repairs(answer.repairs))
    uses = [sum(r.use == use for r in recordings) for use in ("train", "test")]
    lead = f"{len(recordings)} recordings: {uses[0]} for training, {uses[1]} for testing."
    return Section("measured", "Measurements", lead, parts, folded=True)


def _recordings(recordings: Sequence[Recording], material: ReportData) -> Grid:
    head = ("recording", "experiment", "use", "chamber 2", "signals", "samples", "rate", "from – to", "file", "SHA-256")
    steady = material.steady_recordings
    rows: list[Row] = [
        [
            r.name,
            r.experiment + (", imposed motion" if r.imposed else ""),
            r.use,
            r.chamber_2 or "–",
            ", ".join(name for name in r.signals if name != "time"),
            f"{r.samples}",
            "–" if r.name in steady else f"{format_plain(1 / r.period, 6)} Hz",
            "rows" if r.name in steady else f"{format_number(r.from_)} – {format_number(r.to)} s",
            PurePath(r.file).name,
            r.sha256[:10],
        ]
        for r in recordings
    ]
    return Grid(
        "Recordings; all signals are in SI, pressures absolute.", head, rows, folded=len(rows) > MAX_UNFOLDED_ROWS
    )


def _noise(recordings: Sequence[Recording]) -> Grid:
    names = list(dict.fromkeys(name for r in recordings for name in r.noise))
    rows: list[Row] = [[r.name, *(_rms(r.noise.get(name)) for name in names)] for r in recordings]
    caption = "Noise of each sensor, rms: stated in the pipeline file, or estimated from the recordings."
    return Grid(caption, ("recording", *names), rows, folded=True)


def _rms(noise: NoiseAnswer | None) -> str:
    return "–" if noise is None else format_quantity(noise.rms, noise.unit, 2)


def _repairs(repairs: Sequence[Repair]) -> Grid:
    rows: list[Row] = [[r.recording, r.signal, f"{r.count}", r.message] for r in repairs]
    return Grid("Repairs while reading.", ("recording", "signal", "samples", "repair"), rows, folded=len(rows) > 8)
