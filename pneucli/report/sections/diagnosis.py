"""The diagnosis: which physical effect is missing, and what the residual shows of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.ticker import NullFormatter, ScalarFormatter

from pneucli.report.figure import BLUE, GREY, INK, ORANGE, Drawing, drawing, figures
from pneucli.report.material import Material, Table
from pneucli.report.parts import Cell, Figure, Grid, Note, Part, Section
from pneucli.report.shown import axis, number, percent, quantity, shown, shown_unit, signal_unit

Answer = Mapping[str, Any]
SHAPES = 8


def section(material: Material) -> Section | None:
    """Return ladder, candidates and the residual's shape; absent where nothing was diagnosed."""
    answer = material.answer("diagnose")
    if not answer:
        return None
    parts: list[Part] = [
        *_ladder(answer.get("ladder", [])),
        *_shapes(material.table("diagnose/shape"), answer.get("missing", [])),
    ]
    parts += [
        grid
        for grid in (
            _candidates(answer.get("candidates", []), answer.get("missing", [])),
            _moved(answer.get("moved") or []),
        )
        if grid is not None
    ]
    parts += _remarks(answer)
    lead = "Each effect of the catalogue was added in turn and judged by how much of the error it explains."
    return Section("diagnosis", "Diagnosis", lead, parts)


def verdict(answer: Answer) -> Note | None:
    """Return the verdict and why, in one sentence or two."""
    if not answer:
        return None
    missing = " and ".join(answer.get("missing", []))
    words = {
        "adequate": "Nothing is missing that these recordings could show.",
        "missing-effect": f"Missing from the model: {missing}.",
        "unexplained": "Structure remains that no effect of the catalogue accounts for"
        + (f"; {missing} helped." if missing else "."),
    }
    start = words.get(answer.get("verdict", ""), "")
    return Note(f"{start} {answer.get('sentence') or ''}".strip(), "good" if answer["verdict"] == "adequate" else "bad")


def _ladder(steps: Sequence[Answer]) -> list[Figure]:
    if len(steps) < 2:
        return []
    caption = "From top to bottom each effect is added to the model, and the error falls; 1 is the noise floor."
    with drawing(caption, "error, × noise", "effect added", height=1.4 + 0.4 * len(steps)) as one:
        axes = one.axes
        for use, colour, above in (("train", BLUE, 6), ("test", ORANGE, -13)):
            known = [(step[f"error_{use}"], i) for i, step in enumerate(steps) if step.get(f"error_{use}") is not None]
            axes.plot([error for error, _ in known], [i for _, i in known], "o-", color=colour, label=use)
            for error, i in known:
                axes.annotate(
                    number(error, 3), (error, i), (0, above), textcoords="offset points", ha="center", color=colour
                )
        axes.axvline(1.0, color=GREY, linewidth=0.8, linestyle="--")
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_yticks(range(len(steps)), [step["add"] or "model as given" for step in steps])
        axes.margins(x=0.12, y=0.25)
        axes.invert_yaxis()
        axes.legend(loc="lower right")
    return figures([one])


def _shapes(shape: Table, missing: Sequence[str]) -> list[Figure]:
    """Return the residual over the variable that tells an effect, before and after; missing effects first."""
    found = sorted(shape.groups("effect", "recording", "channel", "variable"), key=lambda one: one[0][0] not in missing)
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


def _candidates(candidates: Sequence[Answer], missing: Sequence[str]) -> Grid | None:
    if not candidates:
        return None
    rows = [
        [
            Cell(c["effect"], numeric=False),
            Cell("yes" if c.get("supported") else "no", tone="good" if c["effect"] in missing else "", numeric=False),
            Cell(number(c.get("error_before"), 3)),
            Cell(number(c.get("error_after"), 3)),
            Cell(_parameters(c.get("parameters", {})), numeric=False),
            Cell(", ".join(c.get("indistinguishable_from", [])) or "–", numeric=False),
            Cell(c.get("why", ""), numeric=False),
        ]
        for c in candidates
    ]
    head = ("effect", "supported", "error before", "after", "would be", "not told apart from", "why")
    return Grid("Candidates; errors are in units of the noise floor.", head, rows, folded=len(rows) > 8)


def _parameters(parameters: Mapping[str, Answer]) -> str:
    return "; ".join(
        f"{name} {quantity(p['value'], p['unit'], 3)} ({' – '.join(number(shown(c, p['unit']), 3) for c in p['ci95'])})"
        for name, p in parameters.items()
    )


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
    if share := answer.get("unexplained_share"):
        parts.append(Note(f"{percent(share)} of the error beyond noise stays unexplained."))
    if rest := answer.get("unexplained"):
        words = ", ".join(f"{key}: {value}" for key, value in rest.items() if value)
        parts.append(Note(f"What remains – {words}."))
    if following := answer.get("next_experiment"):
        parts.append(Note(f"Next experiment: {following}"))
    if limits := answer.get("detectable"):
        rows = [[Cell(one["would_show"], numeric=False)] for one in limits]
        parts.append(Grid("What these recordings would have shown.", ("detectable",), rows, folded=len(rows) > 4))
    return parts
