"""The page of a plan: recordings, predictions, differences of the rivals over noise, power, refused manoeuvres."""

from collections.abc import Mapping, Sequence
from itertools import islice

import numpy as np
from matplotlib.axes import Axes

from pneucli.arrays import Array
from pneucli.messages.formatting import axis_title, format_number, format_percent, format_quantity, in_display_unit
from pneucli.messages.plan import GOOD_POWER, Answer
from pneucli.plan.power import Difference, Prediction
from pneucli.quantities import SIGNALS
from pneucli.report.figure import GREY, PALETTE, Line, chart, plain_numbers, reduced
from pneucli.report.overview import Overview, Tile
from pneucli.report.page import render_page
from pneucli.report.page_elements import Cell, Figure, Grid, Note, Part, Section
from pneucli.version import __version__

MAX_SAMPLES = 600  # of a curve
MAX_PLOTTED_RIVALS = 6
LOWEST_DIFFERENCE = 0.1  # of the noise, the bottom of the drawing
RMS_TIME = 0.3  # s, over which differences are averaged


def plan_page(answer: Answer, predictions: Sequence[Prediction]) -> str:
    """Return the page of a plan.

    Args:
        answer: The JSON answer of the plan.
        predictions: Its recordings as the best model predicts them.

    Returns:
        HTML that needs no network.
    """
    sections = [
        _programme(answer),
        *_expected(answer),
        *_recordings(answer, predictions),
        *_power(answer),
        _limits(answer),
    ]
    front = Overview(answer.sentence, _tiles(answer), {}, "", [], "", "", "")
    return render_page(f"{answer.pipeline}: next experiment", front, sections, {"made by": f"pneucli {__version__}"})


def _tiles(answer: Answer) -> list[Tile]:
    count = len(answer.recordings)
    tiles = [Tile("Machine time", f"{answer.seconds:.0f} s", f"{count} recordings, changes between them included")]
    if answer.expected:
        likely = sum(e.is_shown for e in answer.expected)
        text = "hypotheses that the recordings would show if they are true (power of 80 %)"
        tiles.append(Tile("Would be shown", f"{likely} of {len(answer.expected)}", text))
    return tiles


def _programme(answer: Answer) -> Section:
    rows = [
        (
            r.name,
            "fitted" if r.use == "train" else "held out",
            r.manoeuvre,
            f"{r.bench}, {r.drive_title}",
            f"{r.begin:.1f}",
            f"{r.end:.1f}",
        )
        for r in answer.recordings
    ]
    head = ("recording", "use", "manoeuvre", "bench", "from, s", "to, s")
    parts: list[Part] = [Grid("Times of commands.csv", head, rows)]
    parts += [Note(f"{m.recording}: {m.text}", "warning") for m in answer.manual]
    lead = "Make these recordings in this order; steps.md says how, commands.csv holds the commands."
    return Section("programme", "Programme", lead, parts)


def _expected(answer: Answer) -> list[Section]:
    if not answer.rivals:
        return []
    rows = []
    for e in answer.expected:
        found = {r.name: r.times_noise[e.effect] for r in answer.recordings if e.effect in r.times_noise}
        best = max(found, key=found.__getitem__, default=None)
        rows.append(
            (
                e.rival,
                format_percent(e.probability_before),
                Cell(format_percent(e.power), e.power, "good" if e.is_shown else ""),
                format_number(max(found.values(), default=None), 2),
                best or "–",
            )
        )
    head = ("rival", "probability now", "shown if true", "largest difference, × noise", "in")
    lead = (
        "Each rival is the best model with the effect in question at its typical size, or without one that it has. The "
        "probability of being shown counts noise, what the best model already leaves unexplained, and all other "
        "parameters as far as they are unknown."
    )
    return [Section("expected", "What it decides", lead, [Grid("Rivals", head, rows)])] if rows else []


def _recordings(answer: Answer, predictions: Sequence[Prediction]) -> list[Section]:
    sections = []
    for number, (row, one) in enumerate(zip(answer.recordings, predictions, strict=True), 1):
        drawn, time = [], one.outcome.time
        for signal in (row.column, *(["x"] if one.outcome.x is not None else []), "p1"):
            caption = f"{SIGNALS[signal].title}: {'command' if signal == row.column else 'as the best model predicts'}"
            curve = Line(time, in_display_unit(one.outcome.readings[signal], SIGNALS[signal].unit))
            drawn.append(chart(caption, "time in s", axis_title(signal), reduced(curve, MAX_SAMPLES), height=2.3))
        if one.differences:
            drawn.append(_differences(time, dict(islice(one.differences.items(), MAX_PLOTTED_RIVALS))))
        text = row.manoeuvre
        lead = f"{text[0].upper()}{text[1:]}."
        sections.append(Section(f"recording-{number}", row.name, lead, drawn, number > 3))
    return sections


def _differences(time: Array, differences: Mapping[str, Difference]) -> Figure:
    """Draw the running rms of the differences, with the noise shaded and what the best model leaves as a line."""
    caption = (
        "Difference of each rival from the best model (running rms) in the channel where it is largest; grey: noise; "
        "dashed: what the best model leaves unexplained there today"
    )
    lines = []
    for number, (name, curve) in enumerate(differences.items()):
        rms = np.maximum(running_rms(curve.values, time), LOWEST_DIFFERENCE)
        line = Line(time, rms, f"{name} ({curve.channel})", PALETTE[number % len(PALETTE)])
        lines.append(reduced(line, MAX_SAMPLES))

    def scale(axes: Axes) -> None:
        axes.axhspan(LOWEST_DIFFERENCE, 1.0, color="#88888833", linewidth=0.0)
        for level in sorted({round(c.unexplained, 1) for c in differences.values() if c.unexplained > 1.2}):
            axes.axhline(level, color=GREY, linestyle="--", linewidth=0.9)
        axes.set(yscale="log", ylim=(LOWEST_DIFFERENCE, None))
        plain_numbers(axes)

    titles = ("time in s", "difference, × noise")
    return chart(caption, *titles, *lines, legend="outside lower center", ncols=2, height=2.9, extra=scale)


def running_rms(values: Array, time: Array) -> Array:
    """Return the root mean square of values (n,) over RMS_TIME about each time stamp, shape (n,)."""
    length = min(max(1, round(RMS_TIME / float(time[1] - time[0]))), values.size)
    mean = np.convolve(values**2, np.full(length, 1.0 / length), mode="same")
    return np.asarray(np.sqrt(mean))


def _power(answer: Answer) -> list[Section]:
    if not answer.power:
        return []
    least = {p.effect: p.size for p in answer.power if not p.typical}
    rows = []
    for p in sorted((p for p in answer.power if p.typical), key=lambda p: -p.power):
        rows.append(
            (
                p.effect,
                p.parameter,
                format_quantity(p.size, p.unit, 2),
                Cell(format_percent(p.power), p.power, "good" if p.power >= GOOD_POWER else ""),
                format_quantity(least.get(p.effect), p.unit, 2),
            )
        )
    head = ("effect", "parameter", "typical size", "power", "size at 80 % power")
    lead = (
        "The probability that the recordings of this plan show an effect of typical size, and the size that they show."
    )
    return [Section("power", "Power", lead, [Grid("Effects of the catalogue", head, rows)])]


def _limits(answer: Answer) -> Section:
    parts: list[Part] = [Note(text) for text in answer.limit_texts]
    refused = [(one.reason,) for one in answer.refused]
    if refused:
        caption = f"Refused manoeuvres ({answer.refused_count})"
        parts.append(Grid(caption, ("manoeuvre and limit",), refused, folded=True))
    lead = "Every recording was simulated with each rival, and with parameters off by their intervals."
    return Section("limits", "Limits", lead, parts)
