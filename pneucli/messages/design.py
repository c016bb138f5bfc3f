"""How the controller was designed: its corners and sectors, the bench of laws, the margins, and the gate."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import each, labelled, table, warnings
from pneucli.messages.formatting import (
    format_noise_ratio,
    format_number,
    format_percent,
    format_plain,
    format_quantity,
    join_names,
)

Row = Mapping[str, Any]
CAUSES = {
    "": "",
    "travel-time": "the valve is too small: {distance} take at least {time}",
    "speed": "the valve is too small: {asked} are asked, it keeps up with {reachable}",
    "stiffness": "the valve is too small and the air spring too soft: both together give at most {reachable}",
    "resolution": "the position sensor is too coarse: {resolvable}",
    "pressure-bounds": "supply and surroundings bound the pressures",
    "one-spool": (
        "one 5/3 valve fills a chamber as it vents the other: the mean pressure follows from leaks and overlap, too "
        "slowly to be set; two valves set it"
    ),
    "open-chamber-2": "chamber 2 is open, so one valve sets the force alone; two valves set both pressures",
    "sealed-chamber-2": (
        "chamber 2 holds what was sealed in, so one valve sets the force alone; two valves set both pressures"
    ),
}
"""Why the plant cannot meet a requirement, by the code of the cause."""

UNITS = {
    "travel-time": {"distance": (1e3, "mm"), "time": (1.0, "s")},
    "speed": {"asked": (1e3, "mm/s"), "reachable": (1e3, "mm/s")},
    "stiffness": {"reachable": (1.0, "N/m")},
    "resolution": {"resolvable": (1e6, "um")},
}
"""Factor on the SI value and shown unit of each quantity of a cause."""


Answer = Mapping[str, Any]
LOOP_TITLES = {
    "command": "at the command",
    "command 2": "at the second command",
    "position": "at the position's reading",
}
MARGIN_TITLES = ("loop cut", "upper gain margin", "lower gain margin", "phase margin", "delay margin", "modulus margin")
Figures = Mapping[str, Mapping[str, float | None]]  # by scenario
Cases = Mapping[str, Figures]  # by controller
LAW_TITLES = (
    "at rest, µm",
    "moves there, µm",
    "on the way, µm rms",
    "load, s",
    "over 50 Hz, V",
    "air, g",
    "in sliding",
    "result at rest",
)
LAW_LEGEND = (
    "the largest error at rest, how far the piston moves there, the rms error on the way, the time to reject a load to "
    "50 µm, the command's rms above 50 Hz, the share of samples in which the disturbance observers slide: each the "
    "worst of all scenarios; and the air of all of them"
)


def lines(answer: Mapping[str, Any], file: str, verbose: bool) -> Iterator[str]:
    """Yield the corners of the cascade, what the theory says of the axis, warnings, and what to do next."""
    corners = [
        f"{name.replace('_', ' ')} {format_number(c['value'], 3)} rad/s" for name, c in answer["corners"].items()
    ]
    yield from labelled(
        "found", f"a cascade at {format_plain(1e3 * answer['requirements']['period'])} ms: {', '.join(corners)}"
    )
    for name, s in answer["sector"].items():
        yield from labelled("sector", describe_sector(name, s))
    if verbose:
        for name, m in answer["matching"].items():
            yield from labelled("match", f"{name} system: {describe_matching(m)}")
        for t in answer["lmi"]["types"]:
            yield from labelled("PDC", f"weights {t['weight_type']}: {describe_decay_rate(t)}")
    if answer["compare"]:
        yield ""
        yield from table(
            ("controller", *LAW_TITLES),
            list(law_rows(answer["compare"], answer["tolerance_um"])),
            texts=1,
        )
    if rigs := answer.get("ensemble"):
        yield ""
        yield from table(ENSEMBLE_TITLES, list(ensemble_rows(rigs)), texts=1)
    for name, why in answer["not_made"].items():
        yield from labelled("lacks", f"{name}: {why}")
    if verbose and answer["ablation"]:
        yield ""
        rows = list(law_rows(answer["ablation"], answer["tolerance_um"]))
        yield from table(("cascade without", *LAW_TITLES), rows, texts=1)
    yield from margins_and_acceptance(answer, verbose)
    yield from warnings(answer)
    yield from labelled("do", f"pneucli simulate {file}")


def margins_and_acceptance(answer: Mapping[str, Any], verbose: bool) -> Iterator[str]:
    """Yield the margins of the loop, and what the gate found."""
    if (found := answer.get("margins")) and found["points"]:
        yield from each("margins", [*margin_lines(found), *([validity_note(found)] if verbose else [])])
        yield from each("warning", stability_warnings(found))
    if rigs := answer.get("ensemble"):
        yield from each("rigs", promise(rigs))
    if held := answer.get("gate"):
        yield from labelled("gate", acceptance_verdict(held))
        for doubt in violations(held):
            yield from labelled("misses" if held["strict"] else "warning", doubt)


def describe_sector(name: str, found: Mapping[str, Any]) -> str:
    """Return one sliding sector: its lines, and the speed down to which it resolves friction."""
    slopes = f"λ {format_number(found['lambda_1'], 3)} and {format_number(found['lambda_2'], 3)} 1/s"
    steep = (
        "; too steep for the sample time, so the law takes the sector of [design] eta" if found.get("remark") else ""
    )
    return f"{name}: {slopes}, friction resolved down to {format_quantity(found['speed_floor'], 'm/s', 2)}{steep}"


def describe_matching(found: Mapping[str, Any]) -> str:
    """Return whether the matching condition holds, or what breaks it."""
    broken = "; ".join(f"{name} acts on {', '.join(states)}" for name, states in found["broken_by"].items())
    return "the matching condition holds" if found["holds"] else f"the matching condition does not hold: {broken}"


def describe_decay_rate(found: Mapping[str, Any]) -> str:
    """Return the decay rate that a PDC reaches, or why there is none."""
    if found["rate"] is None:
        return f"none: {found['status'].splitlines()[0]}"
    return (
        f"decay rate {format_quantity(found['rate'], '1/s', 3)}, {'verified' if found['verified'] else 'not verified'}"
    )


def cause_text(code: str, quantities: Mapping[str, float]) -> str:
    """Return why the plant cannot meet a requirement; "" where the cause is unknown.

    >>> cause_text("speed", {"asked": 2.0, "reachable": 1.25})
    'the valve is too small: 2000 mm/s are asked, it keeps up with 1250 mm/s'
    """
    units = UNITS.get(code, {})
    return CAUSES[code].format(
        **{n: f"{format_plain(v * units[n][0], 3)} {units[n][1]}" for n, v in quantities.items()}
    )


def acceptance_verdict(acceptance: Row) -> str:
    """Return in one line whether every requirement is met."""
    asked = ", ".join(
        f"{d['demand'].replace('_', ' ')} {format_quantity(d['limit'], d['unit'], 3)}" for d in acceptance["asked"]
    )
    if not acceptance["missed"]:
        return f"met on the model, at the ends of its intervals and on draws ({acceptance['axes']} axes): {asked}"
    return f"{len(acceptance['missed'])} of {len(acceptance['asked'])} requirements are not met"


def violations(acceptance: Row) -> Iterator[str]:
    """Yield a sentence for each requirement that is not met, and one where the model is far from its data."""
    for one in acceptance["missed"]:
        found = "never" if one["found"] is None else format_quantity(one["found"], one["unit"], 3)
        text = (
            f"{one['demand'].replace('_', ' ')}: {found} where {format_quantity(one['limit'], one['unit'], 3)} is asked"
        )
        text += f" ({one['axis']}, {one['scenario']})"
        yield text + (f": {one['cause']}" if one["cause"] else "")
    error = acceptance["model_error"]
    if error is not None and error > acceptance["model_error_limit"]:
        yield (
            f"the model is {format_noise_ratio(error)} × noise from its data: what is designed for it need not hold on "
            "the machine"
        )


def fails_acceptance(acceptance: Row | None) -> bool:
    """Whether an unmet requirement fails like a check."""
    return bool(acceptance and acceptance["strict"] and not acceptance["passed"])


def margin_row(loop: str, worst: Answer) -> tuple[str, ...]:
    """Return the smallest margins of one loop as texts, in the order of MARGIN_TITLES."""
    rise = "× any" if worst["gain_up"] is None else f"× {format_number(worst['gain_up'], 3)}"
    fall = "× any" if not worst["gain_down"] else f"× {format_number(worst['gain_down'], 2)}"
    later = "any" if worst["delay"] is None else f"{format_number(1e3 * worst['delay'], 2)} ms"
    return (
        LOOP_TITLES[loop],
        rise,
        fall,
        f"{format_number(math.degrees(worst['phase']), 2)}°",
        later,
        format_number(worst["modulus"], 2),
    )


def margin_lines(answer: Answer) -> Iterator[str]:
    """Yield a sentence a loop, and what small signals do not tell."""
    for loop, worst in answer["worst"].items():
        _, rise, fall, phase, later, _ = margin_row(loop, worst)
        yield f"{LOOP_TITLES[loop]}: gain {rise} or {fall}, phase {phase}, {later} later"


def stability_warnings(answer: Answer) -> Iterator[str]:
    """Yield what is to be warned of: a loop that grows, or a piston that does not slide."""
    grows = sorted({format_quantity(p["x"], "m", 3) for p in answer["points"] if not p["stable"]})
    if grows:
        yield f"the loop is not stable for small signals at {join_names(grows)}"
    if answer["stuck"]:
        places = sorted({format_quantity(p["x"], "m", 3) for p in answer["stuck"]})
        where = join_names(places)
        yield f"the piston does not slide steadily at {where} at any slow speed, so it has no margin there"


def validity_note(answer: Answer) -> str:
    """Return to what the margins apply, in a sentence or two."""
    speeds = [abs(p["speed"]) for p in answer["points"]]
    if not speeds:
        return "Nothing slid steadily: there are no margins."
    text = f"Small signals about a piston that slides at {format_quantity(min(speeds), 'm/s', 2)}"
    text += f" to {format_quantity(max(speeds), 'm/s', 2)}" if max(speeds) > 1.01 * min(speeds) else ""
    text += "; a piston that sticks does not follow small signals: see the closed-loop scenarios."
    if (width := answer["overlap"]["value"]) > 0.0:
        overlap = format_quantity(width, "V", 2)
        text += f" Nor does the valve within its overlap of {overlap}, over which the inverse map jumps."
    if answer["left_out"]:
        text += f" Left out, as small signals are lost in it: {join_names([t.lower() for t in answer['left_out']])}."
    return text


def observer_at_bound(law: str, observer: str, scenario: str, share: float, limit: float) -> str:
    """Return the warning about a disturbance observer that does not slide; the shares of samples are 0 to 1.

    >>> observer_at_bound("pdc", "force", "sine", 0.35, 0.2)  # doctest: +ELLIPSIS
    'pdc: the force observer is at its bound M_k in 35 % of the samples of sine, above 20 %: its estimate is not ...'
    """
    return (
        f"{law}: the {observer} observer is at its bound M_k in {100 * share:.0f} % of the samples of {scenario}, "
        f"above {100 * limit:.0f} %: its estimate is not the disturbance"
    )


def law_rows(cases: Cases, tolerance_um: float) -> Iterator[list[str]]:
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


ENSEMBLE_TITLES = ("controller", "rigs held", "at rest", "in motion", "under the load", "chattering")
ENSEMBLE_FIGURES = {
    "rest": "at rest",
    "motion": "rms in motion",
    "load": "under a load",
    "chattering": "rms of chattering",
}


def promise(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield the promise of ``best``, and which untold effect limits it."""
    own, limits = found["laws"]["best"], found["limits"]
    asked = ", ".join(
        f"{format_quantity(limits[name]['value'], limits[name]['unit'], 2)} {where}"
        for name, where in ENSEMBLE_FIGURES.items()
    )
    probability, sure = format_percent(own["probability"]), format_percent(found["confidence"])
    yield (
        f"holds {asked} on {own['held']} of {own['rigs']} rigs that the search did not see: on a rig like yours with "
        f"a probability of at least {probability} (confidence {sure})"
    )
    if found["effects"]:
        lacks = join_names(found["effects"])
        yield f"these rigs differ as the recordings allow, and have {lacks}, which the model lacks"
    if found["limiting"]:
        failed = own["rigs"] - own["held"]
        yield (
            f"{found['limiting']} limits it: {found['rescued'][found['limiting']]} of the {failed} rigs that fail hold "
            f"without it. To exclude or to identify it: {found['separate']}"
        )


def ensemble_rows(found: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield a row a controller: rigs that it holds, and its figures over their limits, median and worst."""
    for name, row in found["laws"].items():
        cells = (f"{_times(row['median'][n])}; {_times(row['worst'][n])}" for n in ENSEMBLE_FIGURES)
        yield name, f"{row['held']} of {row['rigs']}", *cells


def _times(ratio: float | None) -> str:
    return "∞" if ratio is None else f"{format_number(ratio, 2)} ×"
