"""The measurements: recordings, their signals, sensor noise, and repairs while reading."""

from collections.abc import Sequence
from pathlib import PurePath

from pneucli.messages.formatting import format_number, format_plain, format_quantity
from pneucli.messages.ingest import Answer, NoiseAnswer, Recording, Repair, implausibility_sentences
from pneucli.report.page_elements import MAX_UNFOLDED_ROWS, Columns, Grid, Note, Part, Row, Section, grid, warning_notes
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
    steady = material.steady_recordings
    columns: Columns[Recording] = {
        "recording": lambda r: r.name,
        "experiment": lambda r: r.experiment + (", imposed motion" if r.imposed else ""),
        "use": lambda r: r.use,
        "chamber 2": lambda r: r.chamber_2 or "–",
        "signals": lambda r: ", ".join(name for name in r.signals if name != "time"),
        "samples": lambda r: f"{r.samples}",
        "rate": lambda r: "–" if r.name in steady else f"{format_plain(1 / r.period, 6)} Hz",
        "from – to": lambda r: "rows" if r.name in steady else f"{format_number(r.from_)} – {format_number(r.to)} s",
        "file": lambda r: PurePath(r.file).name,
        "SHA-256": lambda r: r.sha256[:10],
    }
    caption = "Recordings; all signals are in SI, pressures absolute."
    return grid(caption, recordings, columns, folded=len(recordings) > MAX_UNFOLDED_ROWS)


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
