"""How the controller was designed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import acceptance, labelled, law_comparison, margins, table, warnings
from pneucli.messages.formatting import format_number, format_plain, format_quantity


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
            ("controller", *law_comparison.COLUMN_TITLES),
            list(law_comparison.table_rows(answer["compare"], answer["tolerance_um"])),
            texts=1,
        )
    for name, why in answer["not_made"].items():
        yield from labelled("lacks", f"{name}: {why}")
    if verbose and answer["ablation"]:
        yield ""
        rows = list(law_comparison.table_rows(answer["ablation"], answer["tolerance_um"]))
        yield from table(("cascade without", *law_comparison.COLUMN_TITLES), rows, texts=1)
    yield from margins_and_acceptance(answer, verbose)
    yield from warnings(answer)
    yield from labelled("do", f"pneucli simulate {file}")


def margins_and_acceptance(answer: Mapping[str, Any], verbose: bool) -> Iterator[str]:
    """Yield the margins of the loop, and what the gate found."""
    if (found := answer.get("margins")) and found["points"]:
        for line in [*margins.lines(found), *([margins.validity_note(found)] if verbose else [])]:
            yield from labelled("margins", line)
        for doubt in margins.stability_warnings(found):
            yield from labelled("warning", doubt)
    if held := answer.get("gate"):
        yield from labelled("gate", acceptance.acceptance_verdict(held))
        for doubt in acceptance.violations(held):
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
