"""One evidence against the rules that decide: ``python -m benchmarks.evidence [--kappa K] [--odds O]``.

Judges what ``benchmarks.score`` keeps: the sets of effects that each diagnosis fitted, by their evidence
(``pneucli.diagnose.evidence``), and what the diagnosis said. Both are judged by families: an effect without its
chamber. The log score is -log of the probability of what is true, summed over the effects that any fitted set has.
"""

import argparse
import json
import math
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.cases import Counts, Truth, judged, worlds
from benchmarks.score import KEPT, SETS, package, source_digest
from pneucli.diagnose.evidence import KAPPA, PRIOR_ODDS, SetProbability, VisitedSet, set_probabilities

MIN_STATED, MAX_STATED = 0.003, 0.997  # probabilities, as both may state them
MIN_NAMED = 0.5  # probability, from which on an effect, or one of several, is named
MIN_TWIN, MAX_BOTH = 0.1, 0.1  # probability of a twin, and of both over that of the less probable one
MAX_TWINS = 4
Sides = tuple[Counts, Counts]
Scores = tuple[float, float]


def family(effect: str) -> str:
    """Return the name of an effect without its chamber.

    >>> family("chamber-leak:2")
    'chamber-leak'
    """
    return effect.partition(":")[0]


def families(one: SetProbability) -> frozenset[str]:
    """Return the effects of a set without their chamber."""
    return frozenset(map(family, one.visited.effects))


def presence(sets: Sequence[SetProbability]) -> dict[str, float]:
    """Return the probability of each family of effects: the share of the sets that contain it."""
    names = sorted({name for one in sets for name in families(one)})
    return {name: math.fsum(s.probability for s in sets if name in families(s)) for name in names}


def named(sets: Sequence[SetProbability]) -> list[tuple[str, ...]]:
    """Return the groups of families of which one is present with a probability of ``MIN_NAMED`` or more.

    A group has first its most probable family, then those that replace it: the data hold one of them, hardly two.

    >>> leak, hose = (VisitedSet((name,), {}, {}, 1.0) for name in ("chamber-leak:1", "line-delay"))
    >>> named([SetProbability(leak, 3.0, 0.45), SetProbability(hose, 2.9, 0.4)])
    [('chamber-leak', 'line-delay')]
    """
    probability = presence(sets)
    ranked = sorted((name for name in probability if probability[name] >= MIN_TWIN), key=lambda n: -probability[n])
    groups = list[tuple[str, ...]]()
    while ranked:
        group = [ranked.pop(0)]
        for name in list(ranked):
            if len(group) <= MAX_TWINS and all(_replace_each_other(sets, probability, name, own) for own in group):
                group.append(name)
        if _share(sets, set(group)) >= MIN_NAMED:
            groups.append(tuple(group))
            ranked = [name for name in ranked if name not in group]
    return groups


def _replace_each_other(sets: Sequence[SetProbability], probability: Mapping[str, float], one: str, other: str) -> bool:
    both = math.fsum(s.probability for s in sets if {one, other} <= families(s))
    return both < MAX_BOTH * min(probability[one], probability[other])


def _share(sets: Sequence[SetProbability], names: set[str]) -> float:
    return math.fsum(s.probability for s in sets if names & families(s))


def visited_sets(path: Path) -> list[VisitedSet]:
    """Return the fitted sets of a kept diagnosis."""
    rows = pq.read_table(path).to_pylist()
    by_number = defaultdict(list)
    for row in rows:
        by_number[row["number"]].append(row)
    out = []
    for group in by_number.values():
        effects = tuple(one for one in group[0]["effects"].split(", ") if one)
        sizes = dict(zip(effects, map(float, filter(None, group[0]["sizes"].split(", "))), strict=True))
        channels = {row["channel"]: (row["readings"], row["log_variance"]) for row in group}
        out.append(VisitedSet(effects, channels, sizes, group[0]["cost"]))
    return out


def by_family(truth: Truth) -> Truth:
    """Return a truth without chambers and parameters."""
    return replace(
        truth, hidden=frozenset(map(family, truth.hidden)), mild=frozenset(map(family, truth.mild)), parameters={}
    )


def by_rules(answer: Mapping[str, object]) -> tuple[list[tuple[str, ...]], dict[str, float]]:
    """Return what a diagnosis names, each with its twins, and the probability of each family."""
    candidates = answer["candidates"]
    assert isinstance(candidates, list)
    twins = {c["effect"]: c["indistinguishable_from"] for c in candidates}
    missing = answer["missing"]
    assert isinstance(missing, list)
    groups = [tuple(dict.fromkeys(map(family, (name, *twins.get(name, []))))) for name in missing]
    probability: dict[str, float] = {}
    for c in candidates:
        name = family(c["effect"])
        probability[name] = max(probability.get(name, 0.0), c["confidence_alone"] or 0.0)
    return groups, probability


def counts(truth: Truth, groups: Sequence[tuple[str, ...]]) -> Counts:
    """Return the counts of some names, each with its twins."""
    row = {"exit": 0, "missing": [g[0] for g in groups], "twins": {g[0]: list(g[1:]) for g in groups}, "parameters": {}}
    return judged(truth, row)


def log_score(truth: Truth, names: Iterable[str], probability: Mapping[str, float]) -> float:
    """Return -log of the probability of what is true; of what a rig has a little of nothing is asked."""
    total = 0.0
    for name in set(names) - truth.mild:
        p = min(max(probability.get(name, 0.0), MIN_STATED), MAX_STATED)
        total -= math.log(p if name in truth.hidden else 1.0 - p)
    return total


def compared(truth: Truth, folder: Path, kappa: float, odds: float) -> tuple[Sides, Scores] | None:
    """Return the counts and log scores of rules and evidence; None of a case without a truth or without sets."""
    if not (folder / SETS).is_file() or not truth.names_known:
        return None
    truth = by_family(truth)
    groups, stated = by_rules(json.loads((folder / "diagnose.json").read_text(encoding="utf-8")))
    sets = set_probabilities(visited_sets(folder / SETS), kappa, odds)
    found = presence(sets)
    asked = {*found, *truth.hidden}
    return (counts(truth, groups), counts(truth, named(sets))), (
        log_score(truth, asked, stated),
        log_score(truth, asked, found),
    )


def made_up() -> tuple[Sides, Scores]:
    """Return the comparison of a case with two sets, whose leak both find."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        leak = {"effect": "chamber-leak", "indistinguishable_from": [], "confidence_alone": 0.9}
        (folder / "diagnose.json").write_text(json.dumps({"missing": ["chamber-leak"], "candidates": [leak]}))
        columns = ("number", "effects", "sizes", "cost", "channel", "readings", "log_variance")
        rows = [(0.0, "", "", 9.0, "p1", 1e4, 2e4), (1.0, "chamber-leak", "1", 1.0, "p1", 1e4, 0.0)]
        pq.write_table(pa.table(dict(zip(columns, map(list, zip(*rows, strict=True)), strict=True))), folder / SETS)
        found = compared(Truth(frozenset({"chamber-leak"})), folder, KAPPA, PRIOR_ODDS)
    assert found is not None
    return found


def lines(results: Mapping[str, Sequence[tuple[Sides, Scores]]]) -> Iterator[str]:
    """Yield a table: by world the rules, then the evidence."""
    yield "| world | by | effects in answer | right | false | mild | healthy silent | log score a case |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    for world, cases in results.items():
        for i, by in enumerate(("rules", "evidence")):
            c = sum((sides[i] for sides, _ in cases), Counts())
            score = sum(scores[i] for _, scores in cases) / len(cases)
            cells = (f"{c.found}/{c.effects}", f"{c.right}/{c.known}", f"{c.false}", f"{c.mild}")
            yield f"| {world} | {by} | {' | '.join(cells)} | {c.silent}/{c.healthy} | {score:.2f} |"


def main(arguments: Sequence[str]) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.evidence")
    parser.add_argument("--kappa", type=float, default=KAPPA, help="readings that a disturbed channel is worth")
    parser.add_argument("--odds", type=float, default=PRIOR_ODDS, help="prior odds of an effect")
    parser.add_argument("--kept", type=Path, default=KEPT, help="where benchmarks.score keeps answers")
    parser.add_argument("-v", "--verbose", action="store_true", help="the cases in which both differ")
    parser.add_argument("--small", action="store_true", help="one case that is made up")
    asked = parser.parse_args(list(arguments))
    if asked.small:
        print("\n".join(lines({"made up": [made_up()]})))
        return 0
    code = package(sys.executable)
    kept = asked.kept / source_digest(code)
    results: dict[str, list[tuple[Sides, Scores]]] = {}
    for world in worlds(sys.executable, asked.kept / f"exam-{source_digest(code / 'exam')}", full=True):
        for case in world.cases():
            found = compared(case.truth, kept / case.world / case.name, asked.kappa, asked.odds)
            if found is None:
                continue
            results.setdefault(world.name, []).append(found)
            (rules, evidence), (old, new) = found
            if asked.verbose and (rules != evidence or abs(old - new) > 1.0):
                said = f"right {rules.right} -> {evidence.right}, log score {old:.2f} -> {new:.2f}"
                print(f"{world.name}/{case.name}: {said}")
    if not results:
        print("nothing is kept of this program: run python -m benchmarks.score first", file=sys.stderr)
        return 2
    results["all"] = [one for cases in [*results.values()] for one in cases]
    print("\n".join(lines(results)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
