"""What became of the mutants: scores by package, and the survivors with their reasons."""

import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.mutants.places import Mutant
from tests.mutants.run import Outcome

ACCEPTED = Path(__file__).with_name("accepted.toml")
Reasons = Mapping[tuple[str, str, str], str]


def accepted() -> dict[tuple[str, str, str], str]:
    """Return the reasons why survivors may live, by file and the lines before and after."""
    rows = tomllib.loads(ACCEPTED.read_text()).get("survivor", [])
    return {(row["file"], row["was"], row["now"]): row["reason"] for row in rows}


def report(mutants: Sequence[Mutant], found: Sequence[Outcome], reasons: Reasons) -> str:
    """Return the scores by package and the survivors, each with its reason where one is written, as Markdown."""
    counts = Counter((m.file.split("/")[1], outcome) for m, outcome in zip(mutants, found, strict=True))
    rows = ["| package | mutants | killed | share | timeouts |", "| --- | ---: | ---: | ---: | ---: |"]
    rows += [_row(name, {o: n for (package, o), n in counts.items() if package == name}) for name in _names(counts)]
    alive = [(m, outcome) for m, outcome in zip(mutants, found, strict=True) if outcome != "killed"]
    told = [survivor(m, o, reasons) for m, o in sorted(alive, key=lambda a: (a[0].file, a[0].lines))]
    return "\n".join([*rows, _row("all", Counter(found)), "", *told])


def survivor(mutant: Mutant, outcome: Outcome, reasons: Reasons) -> str:
    """Return file, line, what became of it, why it may live, and the lines that differ."""
    before, after = mutant.diff
    reason = reasons.get((mutant.file, before, after), "-")
    diff = "".join(f"    {sign} {row}\n" for sign, text in (("-", before), ("+", after)) for row in text.splitlines())
    return f"{mutant.file}:{mutant.lines[0]} {outcome}; reason: {reason}\n{diff}"


def _names(counts: Mapping[tuple[str, Outcome], int]) -> list[str]:
    return sorted({package for package, _ in counts})


def _row(name: str, outcomes: Mapping[Outcome, int]) -> str:
    number, killed = sum(outcomes.values()), outcomes.get("killed", 0)
    return f"| {name} | {number} | {killed} | {100 * killed / number:.0f} % | {outcomes.get('timeout', 0)} |"
