"""The diagnosis: the missing physical effect, and its evidence in the residual."""

from collections.abc import Sequence
from dataclasses import replace

from pneucli.messages import diagnose
from pneucli.messages.diagnose import Answer, CandidateAnswer, Discrepancy, Shift
from pneucli.messages.formatting import (
    axis_title,
    format_number,
    format_parameters,
    format_percent,
    format_quantity,
    in_display_unit,
    join_names,
    signal_unit,
    unit_symbol,
)
from pneucli.report.figure import BLUE, GREEN, ORANGE, TEXT_COLOUR, Line, chart, zero_line
from pneucli.report.page_elements import Cell, Columns, Figure, Grid, Note, Part, Row, Section, grid, warning_notes
from pneucli.report.report_data import ReportData, Table

PLACE = 20  # on the page
Colours = tuple[str, str]  # before and after: the first model is blue, the present one orange, a proposed one green
MAX_SHAPES = 4
SEARCHED = (
    "The diagnosis added each effect of the catalogue in turn, fitted the model again, and measured by how much the "
    "error of held-out recordings falls."
)
CONTRADICTED = "The recordings contradict the stated rig, so the diagnosis looked for no effect."
HOW_TO_READ = (
    "Dashed: the contribution of the effect; the closer it lies to the curve before, the more the effect explains."
)


def section(material: ReportData) -> Section | None:
    """Return the evidence for the named effects and the rejected rivals; absent where nothing was diagnosed."""
    if not material.answer("diagnose"):
        return None
    answer = material.read(Answer)
    parts: list[Part] = []
    for former in material.diagnoses:
        if set(former.answer.missing) & set(answer.model.effects):
            parts += [*_verdict(former.answer), *_evidence(former.answer, former.table, (BLUE, ORANGE))]
    parts += _evidence(answer, material.table("diagnose/shape"), (ORANGE, GREEN))  # its verdict is on the first screen
    if answer.missing and (moved := _changed_parameters(answer.moved)):
        parts.append(moved)
    parts += [*_remarks(answer), *_smooth_terms(material.table("diagnose/law")), *warning_notes(material, "diagnose")]
    return Section("diagnosis", "Evidence", CONTRADICTED if answer.impossible else SEARCHED, parts)


def _verdict(answer: Answer) -> list[Part]:
    """Return what an earlier diagnosis found, and its evidence in words."""
    tone = "good" if answer.verdict == "adequate" else ""
    effects = join_names(answer.model.effects)
    return [
        Note(f"Base model{f' with {effects}' if effects else ''}: {answer.sentence}", tone),
        *[Note(f"Evidence: {text}.") for text in (diagnose.evidence_summary(answer),) if text],
    ]


def _evidence(answer: Answer, shape: Table, colours: Colours) -> list[Part]:
    """Return the residual over the decisive variable of the named effects, and the rivals."""
    missing = answer.missing
    looked_for = [] if answer.impossible else answer.candidates
    grid = _candidates(looked_for, missing)
    return [*_shapes(shape, missing, colours), *([grid] if grid else [])]


def _shapes(shape: Table, missing: Sequence[str], colours: Colours) -> list[Figure]:
    """Return the residual over the variable that distinguishes an effect, before and after adding it."""
    groups = shape.groups("effect", "recording", "channel", "variable")
    found = [one for one in groups if one[0][0] in missing][:MAX_SHAPES]
    reading = f" {HOW_TO_READ}"  # once, below the first picture
    return [
        _shape(*map(str, key), rows=rows, colours=colours, more="" if i else reading)
        for i, (key, rows) in enumerate(found)
    ]


def _shape(
    effect: str, recording: str, channel: str, variable: str, *, rows: Table, colours: Colours, more: str
) -> Figure:
    unit, x = rows.text("unit"), in_display_unit(rows["value"], signal_unit(variable))
    before, after, expected = (
        in_display_unit(rows[name], unit) for name in ("residual_before", "residual_after", "expected")
    )
    return chart(
        f"{effect}: the residual of {channel} in {recording} before and after adding it.{more}",
        axis_title(variable),
        f"residual of {channel} in {unit_symbol(unit)}",
        Line(x, before, "before", colours[0], alpha=0.5, width=3.5),
        Line(x, after, "after", colours[1]),
        Line(x, expected, "contribution", TEXT_COLOUR, "--", width=1.0),
        legend="outside upper right",
        ncols=3,
    )


def _smooth_terms(term: Table) -> list[Figure]:
    """Return the smooth term that the model lacks, over its signal."""
    if not len(term):
        return []
    channel, kind, variable, unit = (term.text(name) for name in ("channel", "acts_as", "variable", "unit"))
    caption = (
        f"The part of {channel} that no effect of the catalogue explains, as a function of the signal that explains "
        "most of the held-out residual. If you know a mechanism with a curve of this shape, look for it."
    )
    title = f"{kind} in {unit_symbol(unit)}" if unit_symbol(unit) else kind
    x, y = in_display_unit(term["value"], signal_unit(variable)), in_display_unit(term["law"], unit)
    return [chart(caption, axis_title(variable), title, Line(x, y, colour=ORANGE), extra=zero_line)]


def _candidates(candidates: Sequence[CandidateAnswer], missing: Sequence[str]) -> Grid | None:
    if not candidates:
        return None
    columns: Columns[CandidateAnswer] = {
        "effect": lambda c: c.effect,
        "supported": lambda c: Cell("yes" if c.supported else "no", tone="good" if c.effect in missing else ""),
        "probability": lambda c: format_percent(c.confidence),
        "error before": lambda c: format_number(c.error_before, 3),
        "after": lambda c: format_number(c.error_after, 3),
        "parameters": lambda c: format_parameters(c.parameters),
        "indistinguishable from": lambda c: ", ".join(c.indistinguishable_from) or "–",
        "why": lambda c: c.why,
    }
    fitted = [c for c in candidates if c.parameters]
    caption = (
        f"All {len(candidates)} candidates, {len(fitted)} of them fitted, and why each was accepted or rejected; "
        "errors are × noise"
    )
    found = grid(caption, fitted, columns, folded=True)
    return replace(found, rows=[*found.rows, *_unfitted([c for c in candidates if not c.parameters])])


def _unfitted(candidates: Sequence[CandidateAnswer]) -> list[Row]:
    """Return a row for each reason why candidates were not fitted, with all of those candidates."""
    reasons = dict.fromkeys(c.reason for c in candidates)
    rows: list[Row] = []
    for reason in reasons:
        alike = [c.effect for c in candidates if c.reason == reason]
        why = diagnose.REJECTION_REASONS.get(reason, "")
        rows.append([", ".join(alike), "no", *["–"] * 5, why])
    return rows


def _changed_parameters(moved: Sequence[Shift]) -> Grid | None:
    columns: Columns[Shift] = {
        "parameter": lambda m: m.parameter,
        "from": lambda m: format_quantity(m.from_, m.unit),
        "to": lambda m: format_quantity(m.to, m.unit),
        "plausible": lambda m: Cell("yes" if m.plausible else "no", tone="" if m.plausible else "bad"),
    }
    return grid("Parameters that changed when the effect was added.", moved, columns) if moved else None


def _remarks(answer: Answer) -> list[Part]:
    parts: list[Part] = []
    if answer.unexplained and (explained := diagnose.explaining_signal(answer.unexplained)):
        parts.append(Note(explained))
    parts += _discrepancy(answer.discrepancy)
    if following := answer.next_experiment:
        parts.append(Note(f"Next experiment: {following}"))
    if limits := answer.detectable:
        caption = f"Minimum detectable size of each of the {len(limits)} effects that are not in the model"
        parts.append(grid(caption, limits, {"effect": diagnose.describe_detection_limit}, folded=True))
    return parts


def _discrepancy(discrepancies: Sequence[Discrepancy]) -> list[Part]:
    """Return the table of the discrepancies that remain with all named effects."""
    columns: Columns[Discrepancy] = {
        "channel": lambda one: one.channel,
        "subsystem": lambda one: one.subsystem,
        "× noise": lambda one: format_number(one.size, 3),
        "correlation time": lambda one: format_quantity(one.time_constant_s, "s", 2),
        "function of": lambda one: one.over or "–",
        "share": lambda one: format_percent(one.share),
    }
    caption = "Discrepancies that remain with all named effects, by channel"
    return [grid(caption, discrepancies, columns, folded=True)] if discrepancies else []
