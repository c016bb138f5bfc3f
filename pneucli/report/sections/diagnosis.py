"""The diagnosis: which physical effect is missing, and what the residual shows of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pneucli.messages import diagnose
from pneucli.messages.formatting import (
    axis,
    joined,
    number,
    parameters,
    percent,
    quantity,
    shown,
    shown_unit,
    signal_unit,
)
from pneucli.report.figure import BLUE, INK, ORANGE, Drawing, drawing, figures
from pneucli.report.page_elements import Cell, Figure, Grid, Note, Part, Section, warnings
from pneucli.report.report_data import Material, Table

Answer = Mapping[str, Any]
SHAPES = 4


def section(material: Material) -> Section | None:
    """Return the evidence for what was named and the rivals that were refused; absent where nothing was diagnosed."""
    answer = material.answer("diagnose")
    if not answer:
        return None
    parts: list[Part] = []
    for former in material.diagnoses:
        if set(former.answer["missing"]) & set(answer["model"]["effects"]):
            parts += _evidence(former.answer, former.table)
    parts += _evidence(answer, material.table("diagnose/shape"))
    if moved := _moved(answer.get("moved") or []):
        parts.append(moved)
    parts += [*_remarks(answer), *_unknown(material.table("diagnose/law")), *warnings(material, "diagnose")]
    lead = (
        "Each effect of the catalogue was added in turn, refitted, and judged by how much of the error it explains on "
        "recordings that were not fitted."
    )
    return Section("diagnosis", "Evidence", lead, parts)


def _evidence(answer: Answer, shape: Table) -> list[Part]:
    """Return what a diagnosis named, the residual over what tells it, and the rivals with their reasons."""
    missing = answer["missing"]
    tone = "good" if answer["verdict"] == "adequate" else ""
    effects = joined(answer["model"]["effects"])
    start = f"Base model{f' with {effects}' if effects else ''}"
    parts: list[Part] = [Note(f"{start}: {diagnose.found(answer)}; {diagnose.sure(answer)}.", tone)]
    parts += _shapes(shape, missing)
    grid = _candidates(answer.get("candidates", []), missing)
    return [*parts, *([grid] if grid else [])]


def _shapes(shape: Table, missing: Sequence[str]) -> list[Figure]:
    """Return the residual over the variable that tells an effect, before and after."""
    groups = shape.groups("effect", "recording", "channel", "variable")
    found = [one for one in groups if one[0][0] in missing]
    return figures([_shape(*map(str, key), rows=rows) for key, rows in found[:SHAPES]])


def _shape(effect: str, recording: str, channel: str, variable: str, *, rows: Table) -> Drawing:
    unit = rows.text("unit")
    caption = (
        f"{effect}: the residual of {channel} in {recording} before and after adding it; dashed, what the effect takes "
        "away. The closer the dashed curve lies to the one before, the more it explains."
    )
    with drawing(caption, axis(variable), f"residual of {channel} in {shown_unit(unit)}") as one:
        x = shown(rows["value"], signal_unit(variable))
        curves = {name: shown(rows[name], unit) for name in ("residual_before", "residual_after", "expected")}
        one.axes.plot(x, curves["residual_before"], color=ORANGE, alpha=0.5, linewidth=3.5, label="before")
        one.axes.plot(x, curves["residual_after"], color=BLUE, label="after")
        one.axes.plot(x, curves["expected"], "--", color=INK, linewidth=1.0, label="taken away")
        one.canvas.legend(loc="outside upper right", ncols=3)
    return one


def _unknown(law: Table) -> list[Figure]:
    """Return the law of what no effect accounts for, over its signal."""
    if not len(law):
        return []
    channel, way, variable, unit = (law.text(name) for name in ("channel", "acts_as", "variable", "unit"))
    caption = (
        f"What no effect of the catalogue accounts for, as {channel} shows it: as a function of this signal it "
        "explains most of what was left out. Where the curve has a shape that you know, that is what to look for."
    )
    title = f"{way} in {shown_unit(unit)}" if shown_unit(unit) else way
    with drawing(caption, axis(variable), title) as one:
        one.axes.axhline(0.0, color=INK, linewidth=0.6)
        one.axes.plot(shown(law["value"], signal_unit(variable)), shown(law["law"], unit), color=ORANGE)
    return figures([one])


def _candidates(candidates: Sequence[Answer], missing: Sequence[str]) -> Grid | None:
    if not candidates:
        return None
    rows = [
        [
            Cell(c["effect"], numeric=False),
            Cell("yes" if c.get("supported") else "no", tone="good" if c["effect"] in missing else "", numeric=False),
            Cell(percent(c["confidence"]) if c.get("confidence") is not None else "–"),
            Cell(number(c.get("error_before"), 3)),
            Cell(number(c.get("error_after"), 3)),
            Cell(parameters(c.get("parameters", {})), numeric=False),
            Cell(", ".join(c.get("indistinguishable_from", [])) or "–", numeric=False),
            Cell(c.get("why", ""), numeric=False),
        ]
        for c in candidates
    ]
    head = ("effect", "supported", "probability", "error before", "after", "would be", "not told apart from", "why")
    return Grid("What was tried, and why it was taken or refused; errors are × noise", head, rows, folded=True)


def _moved(moved: Sequence[Answer]) -> Grid | None:
    if not moved:
        return None
    rows = [
        [
            Cell(m["parameter"], numeric=False),
            Cell(quantity(m["from"], m["unit"])),
            Cell(quantity(m["to"], m["unit"])),
            Cell("yes" if m["plausible"] else "no", tone="" if m["plausible"] else "bad", numeric=False),
        ]
        for m in moved
    ]
    return Grid("Parameters that moved when it was added.", ("parameter", "from", "to", "plausible"), rows)


def _remarks(answer: Answer) -> list[Part]:
    parts: list[Part] = []
    share = answer.get("unexplained_share")
    if share and answer["verdict"] != "adequate":
        parts.append(Note(f"{percent(share)} of the error beyond noise stays unexplained."))
    if rest := answer.get("unexplained"):
        parts.append(Note(diagnose.unknown(rest)))
    parts += _discrepancy(answer.get("discrepancy", []))
    if following := answer.get("next_experiment"):
        parts.append(Note(f"Next experiment: {following}"))
    if limits := answer.get("detectable"):
        rows = [[Cell(diagnose.limit(one), numeric=False)] for one in limits]
        parts.append(Grid("From which size on each effect would have shown", ("effect",), rows, folded=True))
    return parts


def _discrepancy(left: Sequence[Answer]) -> list[Part]:
    """Return the table of what is more than noise beside all that was found."""
    rows = [
        [
            Cell(one["channel"], numeric=False),
            Cell(one["subsystem"], numeric=False),
            Cell(number(one["size"], 3)),
            Cell("–" if one["time_constant_s"] is None else quantity(one["time_constant_s"], "s", 2)),
            Cell(one["over"] or "–", numeric=False),
            Cell(percent(one["share"])),
        ]
        for one in left
    ]
    head = ("channel", "subsystem", "× noise", "alike over", "function of", "share")
    return [Grid("What stays beside all that was found, by channel", head, rows, folded=True)] if rows else []
