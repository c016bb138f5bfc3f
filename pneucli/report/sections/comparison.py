"""Model against measurement: how far apart, channel by channel, and both over time, to be zoomed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from pneucli.quantities import CHANNELS
from pneucli.report.decimate import envelope
from pneucli.report.material import Material, Table
from pneucli.report.parts import LONG, Cell, Grid, Note, Panel, Part, Run, Section, Series, Zoom
from pneucli.report.shown import number, quantity, short, shown, shown_unit

SAMPLES = 300_000  # of all plots together: what keeps the page at a size that can be sent by mail
FEWEST, MOST = 200, 4000  # of one curve
NEAR, FAR = 1.2, 2.0  # times the noise floor


def section(material: Material) -> Section | None:
    """Return errors and zoomable plots; absent where nothing was compared."""
    answer = material.answer("compare")
    if not answer:
        return None
    lead = (
        f"The model is started anew from the measured state every {short(answer['horizon_s'])} s and runs freely in "
        "between. An error of 1 × noise is what a correct model would show: sensor noise, also that of the restart "
        "state and of the measured inputs, carried through the model."
    )
    parts: list[Part] = [_overview(answer["channels"]), _errors(answer)]
    residuals = material.table("compare/residuals")
    if len(residuals):
        parts.append(_zoom(residuals, material.table("ingest/signals"), _noise(answer)))
    return Section("comparison", "Model against measurement", lead, parts)


def tone(ratio: float | None) -> str:
    """Return whether an error, in units of the noise floor, is good or bad, or neither."""
    if ratio is None:
        return ""
    return "good" if ratio <= NEAR else "bad" if ratio > FAR else ""


def test_first(channels: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the channels' errors, test recordings before training recordings."""
    return sorted(channels, key=lambda c: c["use"] != "test")


def _noise(answer: Mapping[str, Any]) -> dict[tuple[str, str], float]:
    return {(c["recording"], c["channel"]): c["noise"] for c in answer["channels"] if c["noise"]}


def _overview(channels: Iterable[Mapping[str, Any]]) -> Grid:
    ratios: dict[tuple[str, str], dict[str, float | None]] = {}
    for c in test_first(channels):
        ratios.setdefault((c["recording"], c["use"]), {})[c["channel"]] = c["ratio_to_noise"]
    names = [name for name in CHANNELS if any(name in known for known in ratios.values())]
    rows = [
        [
            Cell(recording, numeric=False),
            Cell(use, numeric=False),
            *(Cell(number(r, 3), tone=tone(r)) if (r := known.get(name)) else Cell("") for name in names),
        ]
        for (recording, use), known in ratios.items()
    ]
    caption = "Error of each channel, × noise; test recordings, which the fit has not seen, stand first."
    return Grid(caption, ("recording", "use", *names), rows, folded=len(rows) > LONG)


def _errors(answer: Mapping[str, Any]) -> Grid:
    head = ("recording", "use", "channel", "RMSD", "of range", "fit", "noise floor", "× noise")
    rows = [
        [
            Cell(c["recording"], numeric=False),
            Cell(c["use"], numeric=False),
            Cell(c["channel"], numeric=False),
            Cell(quantity(c["rmsd"], c["unit"], 3)),
            Cell(f"{number(c['percent'], 2)} %"),
            Cell(f"{number(c['fit_percent'], 3)} %"),
            Cell(quantity(c["noise"], c["unit"], 3)),
            Cell(number(c["ratio_to_noise"], 3), tone=tone(c["ratio_to_noise"])),
        ]
        for c in test_first(answer["channels"])
    ]
    caption = "The same errors in full"
    return Grid(caption, head, rows, folded=True)


def _zoom(residuals: Table, signals: Table, noise: Mapping[tuple[str, str], float]) -> Zoom:
    channels = dict(residuals.groups("recording", "channel"))
    most = int(np.clip(SAMPLES / (4 * len(channels)), FEWEST, MOST))
    inputs = {recording: rows for (recording,), rows in signals.groups("recording")}
    runs: dict[tuple[bool, str], list[Panel]] = {}
    for (recording, channel), rows in channels.items():
        panels = runs.setdefault((rows.text("use") != "test", recording), [])
        if not panels and recording in inputs:
            panels += _command(inputs[recording], most)
        panels.append(_panel(channel, rows, most))
    for (_, recording), panels in runs.items():
        panels.extend(_deviation(recording, channels, noise, most))
    named = [Run(f"{name} ({'train' if train else 'test'})", panels) for (train, name), panels in sorted(runs.items())]
    caption = (
        "Drag over a stretch to zoom in, double-click to see all again. Where a recording has more samples than the "
        "plot, the least and the largest of each stretch are shown, so that no peak is lost."
    )
    return Zoom("comparison", caption, named)


def _command(signals: Table, most: int) -> list[Panel]:
    known = [name for name in ("u", "u2") if name in signals and np.isfinite(signals[name]).any()]
    if not known:
        return []
    kept = envelope([signals[name] for name in known], most)
    curves = [Series(name, "input", signals[name][kept]) for name in known]
    return [Panel("valve command", "V", signals["time"][kept], curves)]


def _panel(channel: str, rows: Table, most: int) -> Panel:
    unit = rows.text("unit")
    kept = envelope([rows["measured"], rows["residual"]], most)
    curves = [Series(role, role, shown(rows[role][kept], unit)) for role in ("measured", "model")]
    return Panel(channel, shown_unit(unit), rows["time"][kept], curves)


def _deviation(
    recording: str, channels: Mapping[tuple[str, str], Table], noise: Mapping[tuple[str, str], float], most: int
) -> list[Panel]:
    """Return measured minus model of all channels, in units of the noise floor, over one time axis."""
    here = {c: rows for (r, c), rows in channels.items() if r == recording and (r, c) in noise}
    if not here:
        return []
    time = next(iter(here.values()))["time"]
    scaled = {c: rows["residual"] / noise[recording, c] for c, rows in here.items()}
    kept = envelope(list(scaled.values()), most)
    curves = [Series(c, "residual", values[kept]) for c, values in scaled.items()]
    return [Panel("measured − model", "× noise", time[kept], curves)]


def verdict(answer: Mapping[str, Any]) -> Note | None:
    """Return one sentence on the error against the noise floor, of the test recordings where there are any."""
    errors = answer.get("error", {})
    use = "test" if errors.get("test") is not None else "train"
    error = errors.get(use)
    if error is None:
        return None
    words = {"good": "The model stands at the noise floor", "bad": "The model misses something"}
    start = words.get(tone(error), "The model comes near the noise floor")
    other = errors.get("train") if use == "test" else None
    more = f" ({number(other, 3)} on training recordings)" if other is not None else ""
    sentence = f"{start}: its error on {use} recordings is {number(error, 3)} × noise{more}."
    worst = _worst(answer["channels"])
    return Note(sentence + worst, "" if worst and tone(error) == "good" else tone(error))


def _worst(channels: Iterable[Mapping[str, Any]]) -> str:
    """Return a sentence on the worst channel where it is far off, which a mean over all may hide."""
    worst = max(channels, key=lambda c: c["ratio_to_noise"] or 0.0, default=None)
    if worst is None or tone(worst["ratio_to_noise"]) != "bad":
        return ""
    return f" Worst: {worst['channel']} in {worst['recording']}, {number(worst['ratio_to_noise'], 3)} × noise."
