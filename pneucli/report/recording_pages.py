"""Pages of single recordings: ``look``, the signals as they would be taken, and ``leak``, the test of a shut vessel."""

import numpy as np

from pneucli.messages import leak, look
from pneucli.messages.formatting import axis_title, format_plain, format_quantity, in_display_unit
from pneucli.messages.init import Column
from pneucli.messages.leak import LAWS, VERDICTS, LeakTest, with_interval
from pneucli.messages.look import Recording
from pneucli.report.figure import Line, chart
from pneucli.report.overview import Overview, Tile
from pneucli.report.page import render_page
from pneucli.report.page_elements import Cell, Grid, Note, Section
from pneucli.version import __version__

TONES = {"pass": "good", "fail": "bad", "undecided": "warning", None: ""}
CURVE_HEIGHT = 1.8  # inches


def look_page(answer: look.Answer) -> str:
    """Return the page of an answer of ``look``: HTML that needs no network."""
    sections = [_columns(answer), *(_recording(one, number) for number, one in enumerate(answer.recordings))]
    count, doubts = len(answer.recordings), len(answer.doubts)
    tiles = [Tile("Recordings", str(count), "as they would be read"), Tile("Doubts", str(doubts), "listed below")]
    sentence = "Signals of the raw files as they would be taken; init writes them into a pipeline file."
    return render_page("look", Overview(sentence, tiles, {}, "", [], "", "", ""), sections, _about())


def _about() -> dict[str, str]:
    return {"made by": f"pneucli {__version__}"}


def _columns(answer: look.Answer) -> Section:
    rows = [
        (
            str(one.column),
            one.signal or "-",
            f"{one.unit}{' gauge' * one.gauge}",
            _range(one),
            one.why.replace("CHECK ", "?  "),
        )
        for one in answer.columns
    ]
    notes = [Note(text, "warning") for text in (*answer.cannot, *answer.doubts)]
    notes += [Note(f"left out: {text}") for text in answer.left_out]
    grid = Grid("Columns of the files", ("column", "taken for", "unit", "range", "why (?: check it)"), rows)
    return Section("columns", "Columns", "What each column is taken for, and what speaks for it.", [grid, *notes])


def _range(one: Column) -> str:
    if one.least is None or one.most is None:
        return ""
    return f"{format_plain(one.least, 4)} to {format_plain(one.most, 4)}"


def _recording(one: Recording, number: int) -> Section:
    drawn = []
    for signal in one.signals:
        rest = signal.rest_text
        caption = f"{signal.signal} of {one.name}" + (f"; rests at {rest}" if rest else "")
        values = np.array([np.nan if value is None else value for value in signal.values])
        curve = Line(signal.time, in_display_unit(values, signal.unit))
        drawn.append(chart(caption, "time, s", axis_title(signal.signal), curve, height=CURVE_HEIGHT))
    head = ("signal", "least", "median", "most", "noise", "missing")
    rows: list[tuple[Cell | str, ...]] = [
        (
            signal.signal,
            *(format_quantity(n, signal.unit) for n in (signal.least, signal.median, signal.most, signal.noise)),
            f"{100 * signal.missing:.1f} %",
        )
        for signal in one.signals
    ]
    lead = f"{one.experiment}, {one.samples} samples, {format_plain(one.seconds, 4)} s"
    return Section(f"recording-{number}", one.name, lead, [*drawn, Grid("Readings", head, rows)])


def leak_page(answer: leak.Answer) -> str:
    """Return the page of an answer of ``leak``: HTML that needs no network."""
    verdict, limit = answer.verdict, answer.limit
    large = "no limit stated" if verdict is None else VERDICTS[verdict].partition(":")[0]
    text = "" if limit is None else f"limit {limit.text}"
    volume = format_quantity(answer.volume, "m^3")
    tiles = [Tile("Verdict", large, text, TONES[verdict]), Tile("Volume", volume, "as stated")]
    sections = [_test(one, answer, number) for number, one in enumerate(answer.tests)]
    head = "; ".join(f"{one.recording}: {one.sentence(limit)}" for one in answer.tests[:1])
    return render_page("leak test", Overview(head, tiles, {}, "", [], "", "", ""), sections, _about())


def _test(one: LeakTest, answer: leak.Answer, number: int) -> Section:
    model = np.array(one.model)
    caption = f"{one.recording} {one.course}; {LAWS[one.law]}"
    curves = (
        Line(one.time, in_display_unit(np.array(one.values), "Pa"), "measured"),
        Line(model[:, 0], in_display_unit(model[:, 1], "Pa"), "model", style="--"),
    )
    drawn = chart(caption, "time, s", axis_title(one.signal), *curves, legend="best", height=2.6)
    grid = Grid(
        "Leak at the first pressure",
        ("quantity", "value with 95 % interval"),
        [(name, with_interval(rate)) for name, rate in one.known.items()],
    )
    notes = [Note(text, "warning") for text in one.doubts(answer.drift)]
    return Section(f"test-{number}", one.recording, one.sentence(answer.limit), [drawn, grid, *notes])
