"""Friction: measurements, its two branches, models A to F, and the error of each model on the recordings."""

from collections.abc import Iterator

import numpy as np

from pneucli.messages.formatting import format_number, format_quantity, in_display_unit
from pneucli.messages.identify import Answer
from pneucli.report.figure import BLUE, GREEN, GREY, ORANGE, PINK, SKY, TEXT_COLOUR, Line, chart
from pneucli.report.page_elements import Figure, Grid, Note, Part, Row, Section
from pneucli.report.report_data import ReportData, Table

PLACE = 80  # on the page
BRANCHES = {"both": GREY, "accelerating": BLUE, "slowing": ORANGE}
MODELS = {
    "A": "parametric Stribeck",
    "B": "TP of A",
    "C": "TP direct from the measurement",
    "D": "parametric with hysteresis",
    "E": "TP of D, one for each branch",
    "F": "TP direct, one for each branch",
}
_COLOURS = dict(zip(MODELS, (TEXT_COLOUR, ORANGE, GREEN, PINK, SKY, BLUE), strict=True))
_LINES = dict(zip(MODELS, ("-", "--", ":", "-", "--", ":"), strict=True))
CHANNELS = ("a", "v", "force")
STRIBECK_RANGE = 0.15  # of the range of velocity: the part in which Stribeck friction is visible
MAX_DOTS = 1500  # dots of a figure


def section(material: ReportData) -> Section | None:
    """Return the friction's figures and tables; absent where none was identified."""
    models = material.table("identify/friction_models")
    if not len(models):
        return None
    curves, cuts = material.table("identify/friction_curves"), material.table("identify/friction_cuts")
    drawn = [_scatter(cuts)] if len(cuts) else []
    drawn += [_curves(curves)] if len(curves) else []
    names = [str(name) for name in dict.fromkeys(models["model"])]
    for group in ([n for n in names if n in "ABC"], [n for n in names if n in "DEF"]):
        drawn += [_models(models, group, curves, is_near_standstill) for is_near_standstill in (False, True) if group]
    if len(kinetic := material.table("identify/friction_kinetic")):
        drawn.append(_kinetic(kinetic))
    lead = "Friction is the force on the piston minus mass times acceleration; its sign is that of the velocity."
    if (found := material.read(Answer).friction) and found.taken_out:
        lead += f" Other forces of the model are subtracted: {', '.join(found.taken_out)}."
    parts: list[Part] = [*friction_warnings(material), *drawn, *_tables(material)]
    return Section("friction", "Friction", lead, parts, folded=True)


def friction_warnings(material: ReportData) -> list[Part]:
    """Return the warnings of the identification of friction."""
    found = material.read(Answer).friction
    return [Note(f"{warning}.", "warning") for warning in (found.warnings if found else ())]


def _scatter(cuts: Table) -> Figure:
    colours = {1.0: ("toward +x", BLUE), -1.0: ("toward −x", ORANGE)}
    step, lines = max(1, len(cuts) // MAX_DOTS), []
    for (direction, _), rows in cuts.groups("direction", "cut"):
        some = rows.rows(np.arange(0, len(rows), step))
        force = some["force"] * (1 if some["force"].mean() > 0 else -1)
        speed, colour = in_display_unit(some["speed"], "m/s"), colours[float(np.sign(direction))][1]
        lines.append(Line(speed, force, colour=colour, width=0.7, alpha=0.7))
    seen = set(np.sign(cuts["direction"]))
    lines += [Line([], [], *label_and_colour) for sign, label_and_colour in colours.items() if sign in seen]
    caption = "Stick-slip events in the recordings: friction over speed, one line for each slip; direction by colour."
    return chart(caption, "speed in mm/s", "friction in N", *lines, legend="best")


def _curves(curves: Table) -> Figure:
    """Draw each direction as a separate line, so that none crosses standstill."""
    lines = []
    for branch, colour in BRANCHES.items():
        rows = curves.where(branch=branch)
        for label, side in ((None, rows["v"] < 0), (branch, rows["v"] > 0)) if len(rows) else ():
            part = rows.rows(np.flatnonzero(side)[np.argsort(rows["v"][side])])
            v, band = in_display_unit(part["v"], "m/s"), (part["ci_low"], part["ci_high"])
            lines.append(Line(v, part["force"], label, colour, band=band))
    caption = "Mean friction over velocity with its 95 % band: where the branches part, friction has hysteresis."
    return chart(caption, "velocity in mm/s", "friction in N", *lines, legend="best")


def _models(models: Table, names: list[str], curves: Table, is_near_standstill: bool) -> Figure:
    titles = "; ".join(f"{name}: {MODELS.get(name, '')}" for name in names)
    caption = f"Models and measured friction (dots). {titles}."
    if set(names) & set("DEF"):
        caption += " Each has a branch for accelerating and one for slowing down."
    if is_near_standstill:
        caption = f"Models {', '.join(names)} near standstill."
    v = in_display_unit((curves if len(curves) else models)["v"], "m/s")
    reach = 1.1 * float(np.abs(v).max()) * (STRIBECK_RANGE if is_near_standstill else 1.0)
    lines = [Line(v, curves["force"], colour=GREY, style=".", size=2, alpha=0.6)] if len(curves) else []
    for name in names:
        colour, style = _COLOURS.get(name, GREY), _LINES.get(name, "-")
        for i, (_, rows) in enumerate(models.where(model=name).groups("branch")):
            lines.append(Line(in_display_unit(rows["v"], "m/s"), rows["force"], None if i else name, colour, style))
    return chart(caption, "velocity in mm/s", "friction in N", *lines, legend="best", xlim=(-reach, reach))


def _kinetic(kinetic: Table) -> Figure:
    over_pressure = np.isfinite(kinetic["p1"]).all()
    x = in_display_unit(kinetic["p1"], "Pa") if over_pressure else in_display_unit(kinetic["speed"], "m/s")
    caption = "Kinetic friction with 95 % intervals, one point for each recording."
    title = "pressure of chamber 1 in bar" if over_pressure else "speed in mm/s"
    bars = kinetic["ci_low"], kinetic["ci_high"]
    points = Line(x, kinetic["friction"], None, BLUE, "o", size=3, bars=bars)
    return chart(caption, title, "friction in N", points, ylim=(0, None))


def _tables(material: ReportData) -> Iterator[Part]:
    if len(deviations := material.table("identify/friction_deviations")):
        yield from _deviations(deviations)
    if len(parameters := material.table("identify/friction_parameters")):
        columns = ("model", "branch", "name", "value", "unit", "ci_low", "ci_high")
        rows: list[Row] = [
            [*map(str, of), *(format_quantity(float(v), str(unit)) for v in (value, low, high))]
            for *of, value, unit, low, high in zip(*(parameters[c] for c in columns), strict=True)
        ]
        head = ("model", "branch", "parameter", "value", "95 % from", "to")
        yield Grid("Parameters of the parametric models.", head, rows)


def _deviations(table: Table) -> Iterator[Part]:
    """Yield tables 6.2 and 6.3 of the thesis for each channel, test recordings first, and who runs away."""
    whole = table.where(recording="all") if (table["recording"] == "all").any() else table
    shown_in = [(use, c) for use in ("test", "train") for c in CHANNELS if len(whole.where(use=use, channel=c))]
    rows = []
    for (model,), of_model in whole.groups("model"):
        cells = [str(model), MODELS.get(model, "")]
        for use, channel in shown_in:
            cells += _deviation(of_model.where(use=use, channel=channel))
        rows.append([*cells, of_model.text("lacks") or "–"])
    titles = [title for use, c in shown_in for title in (f"{c}, {use}", "of range", "times noise")]
    caption = (
        "Root mean square deviation of each model under the measured drive and the pipeline's other forces (tables 6.2 "
        "and 6.3 of the thesis); all recordings of a use together. Times noise: relative to the deviation that sensor "
        "noise causes, which can be large near a break-away or a stop. Lacks: effects on friction in the pipeline that "
        "the model cannot represent."
    )
    yield Grid(caption, ("model", "", *titles, "lacks"), rows)
    yield from _runaways(whole)


def _runaways(table: Table) -> Iterator[Note]:
    """Yield a note for each model whose velocity deviates by more than the measured range: its piston runs away."""
    for (model, use), rows in table.where(channel="v").groups("model", "use"):
        if float(rows["percent"].mean()) > 100.0:
            rmsd = format_quantity(float(rows["rmsd"].mean()), rows.text("unit"), 3)
            yield Note(
                f"The piston of model {model} runs away on the {use} recordings: its velocity deviates by {rmsd}, more "
                "than the measured range. Beyond its measured velocities the model lacks the friction that holds it.",
                "warning",
            )


def _deviation(rows: Table) -> list[str]:
    if not len(rows):
        return ["–"] * 3
    rmsd, noise = (float(rows[name].mean()) for name in ("rmsd", "noise"))
    times = format_number(rmsd / noise, 2) if noise > 0.0 else "–"
    return [
        format_quantity(rmsd, rows.text("unit"), 3),
        f"{format_number(float(rows['percent'].mean()), 2)} %",
        times,
    ]
