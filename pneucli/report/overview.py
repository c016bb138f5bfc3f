"""Compose the first screen of the page: the result in ten seconds of reading."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import FuncFormatter, NullLocator
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.compare.error_regions import error_concentration
from pneucli.messages import compare, design, diagnose, history, ingest, simulate
from pneucli.messages.compare import Answer, ChannelResult, evaluation_error
from pneucli.messages.envelope import envelope_indices, with_gap_indices
from pneucli.messages.formatting import (
    axis_title,
    format_noise_ratio,
    format_number,
    format_parameters,
    format_percent,
    format_plain,
    in_display_unit,
    join_names,
)
from pneucli.messages.history import PathStep
from pneucli.quantities import SIGNALS
from pneucli.report.figure import BLUE, GREY, ORANGE, render, with_gaps
from pneucli.report.report_data import ReportData, Table

LARGE_VERDICTS = {
    "adequate": "nothing further detected",
    "unexplained": "none of the catalogue",
    "inconclusive": "inconclusive",
}
MAX_PURPOSE = 60  # characters of what an experiment is for: one line beside the picture
MAX_STEPS = 5  # of the selection path: of more models, the first and the last ones are drawn


@dataclass(frozen=True)
class Tile:
    """One of the three results: a title, a large figure, a sentence, and whether that is good or bad."""

    title: str
    large: str
    text: str
    tone: str = ""


@dataclass(frozen=True)
class Bar:
    """A bar of the selection path: its model, the error over noise of it as text, and its length (0 to 1)."""

    step: PathStep
    error: str
    length: float


@dataclass(frozen=True)
class Overview:
    """The contents of the first screen; the picture is drawn for a desk and for a telephone."""

    line: str
    tiles: Sequence[Tile]
    pictures: Mapping[str, str]
    caption: str
    ladder: Sequence[Bar]
    failed: str
    following: str
    checks: str
    doubt: str = ""


def overview(material: ReportData) -> Overview:
    """Return the first screen, from those answers that exist."""
    found = find_worst_recording(material)
    pictures, caption = worst_recording_figure(found) if found else ({}, "")
    return Overview(
        line=_headline(material),
        tiles=[tile for tile in (_model(material), _missing(material), _controller(material)) if tile is not None],
        pictures=pictures,
        caption=caption,
        ladder=selection_path(material),
        failed=_worst_failure(material, found.channel.recording if found else ""),
        following=_next_command(material),
        checks=_checks(material),
        doubt=_first_doubt(material),
    )


def _headline(material: ReportData) -> str:
    """Return rig, date, model and recordings in one line."""
    compared, recordings = material.read(compare.Answer), material.read(ingest.Answer).recordings
    parts = [material.rig]
    if compared.when:
        parts.append(f"compared on {compared.when[:10]}")
    if "model" in material.answer("compare"):
        effects = join_names(compared.model.effects)
        parts.append(f"base model{f' with {effects}' if effects else ''}")
    if recordings:
        tests = sum(one.use == "test" for one in recordings)
        parts.append(f"{len(recordings)} recordings, {tests} held out")
    return " · ".join(filter(None, parts))


def _comparable_models(material: ReportData) -> list[history.Model]:
    """Return the models that were compared with the present data, oldest first, the present one last."""
    return history.models_on_current_data(material.history) if material.history else []


def _model(material: ReportData) -> Tile | None:
    """Return the error of the model, and that of the first one."""
    answer = material.read(compare.Answer)
    use, error = compare.evaluation_error(answer.error)
    if error is None:
        return None
    here = _comparable_models(material)
    first = here[0].error[use] if len(here) > 1 else None
    large = (
        f"{format_noise_ratio(first)} → {format_noise_ratio(error)} × noise"
        if first is not None
        else f"{format_noise_ratio(error)} × noise"
    )
    added = [name for name in here[-1].effects if name not in here[0].effects] if here else []
    sizes = format_parameters(here[-1].added(added)) if added else ""
    text = (
        f"with {join_names(added)}: {sizes}{_stated_probability(material, added)}."
        if added
        else f"{answer.verdict.partition(': ')[2]}."
    )
    if use == "train":
        text += " No recording was held out: this is the error of the fitted recordings."
    elif worst := answer.worst_channel:
        text += f" Worst: {worst}."
    return Tile("The model", large, text[:1].upper() + text[1:], answer.rating)


def _stated_probability(material: ReportData, added: Sequence[str]) -> str:
    """Return the probability that the diagnosis stated for the added effects; "" where it stated none."""
    candidates = [c for one in material.diagnoses for c in one.answer.candidates]
    stated = {c.effect: c.confidence for c in candidates if c.effect in added and c.confidence}
    if not stated:
        return ""
    is_single = len(stated) == 1
    each = [format_percent(p) if is_single else f"{name} {format_percent(p)}" for name, p in stated.items()]
    return f"; present with a probability of {join_names(each)}"


def _missing(material: ReportData) -> Tile | None:
    """Return the verdict of the diagnosis, and the evidence for it."""
    if not material.answer("diagnose"):
        return None
    answer = material.read(diagnose.Answer)
    evidence = diagnose.evidence_summary(answer)
    text = f"{answer.sentence}{f' Evidence: {evidence}.' if evidence else ''}"
    large = join_names(answer.missing) or LARGE_VERDICTS[answer.verdict]
    return Tile("Missing effect", large, text, "good" if answer.verdict == "adequate" else "bad")


def _controller(material: ReportData) -> Tile | None:
    """Return the accuracy of the controller on the identified model, and the scenarios in which it fails."""
    answer = material.read(simulate.Answer)
    if answer.closed_loop is None:
        return None
    rest, *others = answer.worst_metrics or ["nothing measured"]
    failed = answer.failed_scenarios
    large, _, tolerance = rest.partition(" (")
    text = f"Simulated, {join_names([tolerance.rstrip(')'), *others])}." if tolerance else "Simulated."
    if comparison := material.read(design.Answer).comparison:
        text += f" {comparison}"
    if failed:
        text += f" Fails: {join_names(failed)}."
    tone = "good"
    if harmful := answer.harmful_effects:
        tone = ""
        text += f" Not robust against {join_names(harmful)} if the design does not include it."
    return Tile("The controller", large, text, "bad" if failed else tone)


def selection_path(material: ReportData) -> list[Bar]:
    """Return the models on this data and those with the diagnosed effects, each with its error."""
    here = _comparable_models(material)
    if not here:
        return []
    use, _ = compare.evaluation_error(here[-1].error)
    shown = here if len(here) <= MAX_STEPS else [*here[: MAX_STEPS // 2], *here[MAX_STEPS // 2 - MAX_STEPS :]]
    steps = history.path_steps(shown, material.read(diagnose.Answer))
    most = max([2.0, *(error for step in steps if (error := step.error[use]) is not None)])
    return [Bar(s, format_noise_ratio(s.error[use]), history.bar_share(s.error[use], most)) for s in steps]


def _worst_failure(material: ReportData, pictured: str) -> str:
    """Return in one sentence where the model fails worst, preferably in the recording that is ``pictured``."""
    answer = material.first_comparison.answer if material.first_comparison else material.read(compare.Answer)
    found = sorted(answer.events, key=lambda event: event[0].recording != pictured)
    if not found:
        return answer.even_error if material.answer("compare") else ""
    return f"{'It failed' if material.first_comparison else 'It fails'} most in {compare.describe_event(found[0])}."


def _next_command(material: ReportData) -> str:
    """Return the next step, with its command."""
    answer = material.read(diagnose.Answer)
    if not material.answer("diagnose"):
        return f"Next: pneucli diagnose {material.file}" if material.answer("compare") else ""
    if answer.verdict == "adequate" and material.read(simulate.Answer).closed_loop is not None:
        return f"Next: pneucli export {material.file} --to c"
    if answer.next_experiment and not answer.missing and not answer.impossible:
        purpose, colon, _ = answer.next_experiment.partition(":")
        is_whole = colon and "(" not in purpose  # a colon in brackets explains a word
        about = (
            f"{purpose[:1].lower()}{purpose[1:]}, see"
            if is_whole and len(purpose) <= MAX_PURPOSE
            else "the experiment in"
        )
        return f"Next: {about} the chapter Evidence"
    following = diagnose.next_step(answer, material.file, otherwise="").partition("; or: ")[0]
    return f"Next: {following}" if following else ""


def _checks(material: ReportData) -> str:
    failed = [check.path for check in material.checks if check.failure]
    if failed:
        return f"Failed checks: {join_names(failed)}."
    return f"Checks: {format_number(float(len(material.checks)), 1)} passed." if material.checks else ""


def _first_doubt(material: ReportData) -> str:
    """Return the first implausible finding that the verdict does not state already, and the number of others."""
    stated = material.read(diagnose.Answer).impossible
    found = ingest.implausibility_sentences(material.read(ingest.Answer).plausibility)
    first, *more = [*(one for one in found if one not in stated), ""]
    others = f" {len(more) - 1} more under Measurements." if len(more) > 1 else ""
    return f"Doubtful: {first}.{others}" if first else ""


FIGURE_SIZES = {"wide": (8.6, 4.3), "narrow": (4.3, 4.6)}  # inches, on a desk and on a telephone
MAX_SAMPLES = 1500  # samples of a curve
CONTEXT_RESTARTS = 2.0  # restart intervals on each side of the marked interval; at least the interval's own length
BAND_SIGMA = 2.0  # standard deviations


@dataclass(frozen=True)
class WorstRecording:
    """The worst channel, with its residuals: of the present model, and of the first one where there was another.

    ``first`` is that of the first model, ``stretch`` the interval (s) in which the error is worst.
    """

    channel: ChannelResult
    rows: Table
    first: ChannelResult | None
    before: Table | None
    stretch: tuple[float, float] | None
    horizon: float


def worst_recording_figure(found: WorstRecording) -> tuple[dict[str, str], str]:
    """Return the picture as SVG in each of ``FIGURE_SIZES``, and its caption."""
    pictures = {name: render(partial(_draw, found), *size) for name, size in FIGURE_SIZES.items()}
    one, held_out = found.channel, "held-out " if found.channel.use == "test" else ""
    ratio = " → ".join(format_noise_ratio(of.ratio_to_noise) for of in (found.first, one) if of)
    shaded = "Shaded: the interval with the largest error. " if found.stretch else ""
    return pictures, (
        f"{one.channel} in {one.recording}, the worst {held_out}recording: {ratio} × noise. {shaded}Below: "
        f"measured − model, with the band of ± {format_plain(BAND_SIGMA)} σ of a correct model. The model restarts "
        f"from the measurement every {format_plain(found.horizon)} s (ticks)."
    )


def find_worst_recording(material: ReportData) -> WorstRecording | None:
    """Return the channel with the largest error over noise, that of the first model where there was one."""
    answer, residuals = material.read(Answer), material.table("compare/residuals")
    first = material.first_comparison
    judge = first.answer if first else answer
    use, _ = evaluation_error(answer.error)
    channels = {c.key: c for c in answer.channels if c.noise > 0.0}
    ratios = [
        c
        for c in judge.channels
        if c.use == use
        and c.ratio_to_noise > 0.0
        and c.key in channels
        and c.recording not in material.steady_recordings  # they have a chapter of their own, over pressures
    ]
    if not ratios or not len(residuals):
        return None
    worst = max(ratios, key=lambda c: c.ratio_to_noise)
    rows = _rows(residuals, worst)
    earlier = _rows(first.table, worst) if first else None
    if earlier is not None and len(earlier) != len(rows):
        earlier = None
    error = rows["residual"] if earlier is None else earlier["residual"]
    stretch = error_concentration(rows["time"], np.nan_to_num(error) ** 2)
    before = None if earlier is None else worst
    return WorstRecording(
        channels[worst.key], rows, before, earlier, stretch[:2] if stretch else None, answer.horizon_s
    )


def _rows(residuals: Table, channel: ChannelResult) -> Table:
    return residuals.where(recording=channel.recording, channel=channel.channel)


def _draw(found: WorstRecording, canvas: Canvas) -> None:
    upper, lower = canvas.subplots(2, 1, sharex=True, height_ratios=[2.4, 1])
    indices = _shown_samples(found)
    rows, one = found.rows.rows(indices), found.channel
    curves = [("measured", rows["measured"], GREY, "-", 3.0)]
    if found.before is not None:
        curves.append(("before", found.before["model"][indices], BLUE, "--", 1.3))
    curves.append(("model" if found.before is None else "after", rows["model"], ORANGE, "-", 1.3))
    for label, values, colour, style, width in curves:
        drawn = values if label == "measured" else with_gaps(values, rows["segment"])
        upper.plot(rows["time"], in_display_unit(drawn, one.unit), style, color=colour, linewidth=width, label=label)
        if label != "measured":
            residual = with_gaps(rows["measured"] - values, rows["segment"]) / one.noise
            lower.plot(rows["time"], residual, style, color=colour, linewidth=1.0)
    _frame(found, upper, lower, rows["time"])
    upper.set_ylabel(axis_title(one.channel).replace(SIGNALS[one.channel].title, one.channel))
    canvas.legend(loc="outside upper left", ncols=3)


def _frame(found: WorstRecording, upper: Axes, lower: Axes, time: Array) -> None:
    """Mark the interval with the largest error, the restarts and the band of the noise."""
    starts = found.rows["time"][np.flatnonzero(np.diff(found.rows["segment"])) + 1]
    for axes in (upper, lower):
        if found.stretch:
            axes.axvspan(*found.stretch, color=ORANGE, alpha=0.12, linewidth=0)
    upper.plot(starts, np.zeros(starts.size), "|", color=GREY, markersize=7, transform=upper.get_xaxis_transform())
    lower.axhspan(-BAND_SIGMA, BAND_SIGMA, color=GREY, alpha=0.3, linewidth=0)
    lower.set_yscale("symlog", linthresh=BAND_SIGMA, linscale=0.6)
    most = max(abs(end) for end in lower.get_ylim())
    powers = [10.0**k for k in range(1, 7) if 10.0**k < most]
    lower.set_yticks([*(-p for p in powers), -BAND_SIGMA, BAND_SIGMA, *powers], minor=False)
    lower.yaxis.set_major_formatter(FuncFormatter(lambda value, _: format_plain(value)))
    lower.yaxis.set_minor_locator(NullLocator())
    lower.set(xlabel="time in s", ylabel="× noise", xlim=(time[0], time[-1]))


def _shown_samples(found: WorstRecording) -> NDArray[np.int64]:
    """Return the samples to draw: the marked interval and as much on each side, with every peak."""
    time = found.rows["time"]
    low, high = found.stretch or (time[0], time[-1])
    margin = max(high - low, CONTEXT_RESTARTS * found.horizon)
    window = np.flatnonzero((time >= low - margin) & (time <= high + margin))
    rows, before = found.rows.rows(window), [] if found.before is None else [found.before["model"][window]]
    curves, error = [rows["measured"], *before, rows["model"]], rows["measured"] - rows["model"]
    return window[with_gap_indices(envelope_indices(curves, MAX_SAMPLES), error)]
