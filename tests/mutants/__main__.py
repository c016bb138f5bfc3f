"""``python -m tests.mutants``: mutate a sample of the code and say what the unit tests do not notice (docs: README)."""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from tests.mutants.places import Mutant, sample, shares
from tests.mutants.run import ROOT, TOGETHER, Outcome, contexts, copied, outcomes

PACKAGES = {
    "pneucli/identify": ("tests/identify", "tests/identify_friction", "tests/identify_valve"),
    "pneucli/diagnose": ("tests/diagnose",),
    "pneucli/compare": ("tests/compare",),
    "pneucli/noise": ("tests/noise",),
    "pneucli/design": ("tests/design",),
    "pneucli/exam": ("tests/exam",),
}
WANTED = 0.85
ACCEPTED = Path(__file__).with_name("accepted.toml")


def main() -> None:
    """Draw, run, report; exit 1 where fewer than WANTED are killed."""
    asked = _arguments()
    print(f"seed {asked.seed}", flush=True)
    began = time.monotonic()
    packages = tuple(p for p in PACKAGES if not asked.package or p.endswith(tuple(asked.package)))
    mutants = sample(ROOT, shares(ROOT, packages, asked.number), asked.seed)
    mutants = [m for m in mutants if asked.file in m.file]
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        first = copied(Path(folder, "0"))
        known = contexts(first, packages, [f for p in packages for f in PACKAGES[p]])
        trees = [first, *(copied(Path(folder, str(i)), first) for i in range(1, TOGETHER))]
        found = outcomes(mutants, known, trees, _say)
    print("\n" + report(mutants, found, accepted()))
    print(f"{time.monotonic() - began:.0f} s")
    sys.exit(found.count("killed") < WANTED * len(found))


def accepted() -> dict[tuple[str, str, str], str]:
    """Return the reasons why survivors may live, by file and the lines before and after."""
    rows = tomllib.loads(ACCEPTED.read_text()).get("survivor", [])
    return {(row["file"], row["was"], row["now"]): row["reason"] for row in rows}


def report(mutants: Sequence[Mutant], found: Sequence[Outcome], reasons: dict[tuple[str, str, str], str]) -> str:
    """Return the scores by package and the survivors, each with its reason where one is written, as Markdown."""
    counts = Counter((m.file.split("/")[1], outcome) for m, outcome in zip(mutants, found, strict=True))
    names = sorted({package for package, _ in counts})
    rows = ["| package | mutants | killed | share | timeouts |", "| --- | ---: | ---: | ---: | ---: |"]
    for name in [*names, "all"]:
        mine = {o: n for (package, o), n in counts.items() if package == name} if name != "all" else Counter(found)
        number, killed = sum(mine.values()), mine.get("killed", 0)
        rows.append(f"| {name} | {number} | {killed} | {100 * killed / number:.0f} % | {mine.get('timeout', 0)} |")
    alive = [(m, outcome) for m, outcome in zip(mutants, found, strict=True) if outcome != "killed"]
    return "\n".join([*rows, "", *(_survivor(m, o, reasons) for m, o in sorted(alive, key=lambda a: a[0].file))])


def _survivor(mutant: Mutant, outcome: Outcome, reasons: dict[tuple[str, str, str], str]) -> str:
    before, after = mutant.diff
    reason = reasons.get((mutant.file, before, after), "-")
    diff = "".join(f"    {sign} {row}\n" for sign, text in (("-", before), ("+", after)) for row in text.splitlines())
    return f"{mutant.file}:{mutant.lines[0]} {outcome}; reason: {reason}\n{diff}"


def _say(mutant: Mutant, outcome: Outcome) -> None:
    print("." if outcome == "killed" else f"\n{_survivor(mutant, outcome, {})}", end="", flush=True)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6), help="of the sample")
    parser.add_argument("--number", type=int, default=300, help="of mutants")
    parser.add_argument("--package", action="append", help="only this one, such as noise; may be given several times")
    parser.add_argument("--file", default="", help="of the sample only what is in files whose path holds this")
    return parser.parse_args()


main()
