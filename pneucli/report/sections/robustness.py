"""Robustness: the checks that hold on axes that differ from the model, and the error under each effect."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pneucli.messages.formatting import format_bounded, format_plain
from pneucli.messages.simulate import METRIC_TITLES, Answer, CheckRate, SuccessRate
from pneucli.report.page_elements import Cell, Grid, Note, Part, Row, Section
from pneucli.report.report_data import ReportData, Table

PLACE = 120  # on the page
Rates = Mapping[tuple[str, str], SuccessRate]  # by effect and check
RESIDUAL_ERROR_FIGURES = ("steady_um", "tracking_rms_um", "recovery_s", "load_error")
BASE = {"all": "all runs", "": "none"}  # rows that belong to no effect


def section(material: ReportData) -> Section | None:
    """Return the Monte Carlo study by effect; absent where none was run."""
    answer = material.read(Answer).robust
    if answer is None:
        return None
    rates = {(r.effect, r.check): r for r in answer.by_effect}
    checks = answer.checks
    effects = sorted({effect for effect, _ in rates}, key=lambda e: (e != "all", e != "", _share(rates, e, checks), e))
    lead = (
        f"The same controller on {answer.runs} axes that differ from the model: parameters drawn from their "
        "intervals, the rig's values from tolerances, and in turn one effect that the design does not include, of "
        f"plausible size (seed {answer.seed})."
    )
    harmful = [e for e in effects if e in BASE or _share(rates, e, checks) < 1.0]
    parts: list[Part] = [_rates(rates, checks, harmful)]
    if harmless := [e for e in effects if e not in harmful]:
        parts.append(Note(f"Every check held with {', '.join(harmless)}.", "good"))
    parts += _residual_errors(material.table("simulate/robust"), effects)
    return Section("robustness", "Robustness", lead, parts, folded=True)


def _rates(rates: Rates, checks: Mapping[str, CheckRate], effects: Sequence[str]) -> Grid:
    head = ("effect", *(f"{METRIC_TITLES.get(c, c)} ≤ {format_plain(v.limit)}" for c, v in checks.items()))
    rows: list[Row] = [[BASE.get(e, e), *(_pass_rate(rates.get((e, c))) for c in checks)] for e in effects]
    caption = (
        "Number of runs in which each check held, over all scenarios, and the worst value. The most harmful effects "
        "come first."
    )
    return Grid(caption, head, rows)


def _share(rates: Rates, effect: str, checks: Iterable[str]) -> float:
    mine = [rates[effect, check] for check in checks if (effect, check) in rates]
    return sum(r.held for r in mine) / sum(r.runs for r in mine)


def _pass_rate(rate: SuccessRate | None) -> Cell | str:
    if rate is None:
        return "–"
    text = f"{rate.held} of {rate.runs}; {format_bounded(rate.worst)}"
    return Cell(text, tone="" if rate.held == rate.runs else "bad")


def _residual_errors(runs: Table, effects: Sequence[str]) -> list[Grid]:
    """Return the median error figures of the runs with each effect."""
    if not len(runs):
        return []
    names = [name for name in RESIDUAL_ERROR_FIGURES if name in runs]
    of = {effect: runs if effect == "all" else runs.where(effect=effect) for effect in effects}
    rows: list[Row] = [[BASE.get(e, e), *(_median(mine, n) for n in names)] for e, mine in of.items()]
    caption = "Error under each effect, median of its runs; “none”: without any additional effect"
    return [Grid(caption, ("effect", *(METRIC_TITLES[n] for n in names)), rows, folded=True)]


def _median(runs: Table, name: str) -> str:
    values = runs[name][~np.isnan(runs[name])]
    return format_bounded(float(np.median(values)) if values.size else np.nan)
