"""What the bench of controllers shows: a row a law, and which laws are poor and how."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages.formatting import format_number, join_names

Figures = Mapping[str, Mapping[str, float | None]]  # by scenario
Cases = Mapping[str, Figures]  # by controller
COLUMN_TITLES = (
    "at rest, µm",
    "moves there, µm",
    "on the way, µm rms",
    "load, s",
    "over 50 Hz, V",
    "air, g",
    "in sliding",
    "result at rest",
)
COLUMN_LEGEND = (
    "the largest error at rest, how far the piston moves there, the rms error on the way, the time to reject a load to "
    "50 µm, the command's rms above 50 Hz, the share of samples in which the disturbance observers slide: each the "
    "worst of all scenarios; and the air of all of them"
)


def observer_at_bound(law: str, observer: str, scenario: str, share: float, limit: float) -> str:
    """Return the warning about a disturbance observer that does not slide; the shares of samples are 0 to 1.

    >>> observer_at_bound("pdc", "force", "sine", 0.35, 0.2)  # doctest: +ELLIPSIS
    'pdc: the force observer is at its bound M_k in 35 % of the samples of sine, above 20 %: its estimate is not ...'
    """
    return (
        f"{law}: the {observer} observer is at its bound M_k in {100 * share:.0f} % of the samples of {scenario}, "
        f"above {100 * limit:.0f} %: its estimate is not the disturbance"
    )


def table_rows(cases: Cases, tolerance_um: float) -> Iterator[list[str]]:
    """Yield a row a controller: the worst of all its scenarios, the air of all, and what it comes to."""
    for name, figures in cases.items():
        worst = [worst_value(figures, key) for key in ("steady_um", "cycle_um", "tracking_rms_um")]
        recovery = [f["recovery_s"] for f in figures.values() if f["peak_um"] is not None]
        fast, air = worst_value(figures, "fast_v"), sum(f["air_kg"] or 0.0 for f in figures.values())
        yield [
            name,
            *("–" if w is None else format_number(w, 3) for w in worst),
            "–"
            if not recovery
            else "∞"
            if None in recovery
            else format_number(max(r for r in recovery if r is not None), 2),
            "–" if fast is None else format_number(fast, 2),
            format_number(1e3 * air, 3),
            _sliding(figures),
            rest_verdict(figures, tolerance_um),
        ]


def _sliding(figures: Figures) -> str:
    """Return the least share of samples in sliding, of both observers over all scenarios."""
    shares = [f.get(key) for f in figures.values() for key in ("sliding_load", "sliding_flow")]
    finite = [share for share in shares if share is not None]
    return f"{100.0 * min(finite):.0f} %" if finite else "–"


def worst_value(figures: Figures, key: str) -> float | None:
    """Return the largest value of a figure over all scenarios; None where none shows it."""
    return max((f[key] for f in figures.values() if f[key] is not None), default=None)  # type: ignore[type-var]


def rest_verdict(figures: Figures, tolerance_um: float) -> str:
    """Return what becomes of the piston at rest: held, off the reference, moving."""
    off, moved = (worst_value(figures, key) or 0.0 for key in ("steady_um", "cycle_um"))
    faults = [f"stays up to {_length(off)} off"] if off > tolerance_um else []
    faults += [f"moves by {_length(moved)} at rest"] if moved > tolerance_um else []
    return ", ".join(faults) or "holds"


def comparison_sentence(answer: Mapping[str, Any]) -> str:
    """Return in one sentence which laws hold the tolerance at rest, and how far off the others stay."""
    tolerance, cases = answer.get("tolerance_um"), answer.get("compare") or {}
    if not tolerance or len(cases) < 2:
        return ""
    off = {name: worst_value(figures, "steady_um") for name, figures in cases.items()}
    hold = [name for name, figures in cases.items() if rest_verdict(figures, tolerance) == "holds"]
    others = sorted((um, name) for name, um in off.items() if name not in hold and um is not None)
    named = join_names([f"“{name}”" for name in hold]) or "none"
    text = f"of {len(cases)} laws {named} {'holds' if len(hold) < 2 else 'hold'} it"
    runner_up = f"; next is “{others[0][1]}”, {_length(others[0][0])} off" if others else ""
    return f"{text[:1].upper()}{text[1:]}{runner_up}."


def _length(um: float) -> str:
    """Return a length as people say it."""
    return f"{format_number(um, 2)} µm" if um < 1000.0 else f"{format_number(1e-3 * um, 2)} mm"


def shortcomings(cases: Cases, tolerance_um: float) -> list[str]:
    """Return a sentence for each controller that does not hold the tolerance at rest."""
    verdicts = {name: rest_verdict(figures, tolerance_um) for name, figures in cases.items()}
    return [f"{name} {verdict}" for name, verdict in verdicts.items() if verdict != "holds"]
