"""False alarms and power of each guard of ``plausibility`` and ``io``: ``python -m benchmarks.guards [EXAM...]``.

False alarms: how often a guard speaks in the true recordings of every world (fixtures, cases of an EXAM, and
``../shared`` or PNEUCLI_SHARED; up to 8 pipelines of each, evenly spread, or all with ``--full``), as recorded and at
100 Hz to 10 kHz; contradictions, then doubts. Power: in how many of the false data sets that it has to find, of
``tests/plausibility/faulty_data_sets.py``, it speaks. ``--write`` puts the table into ``docs/data-checks.md``.
"""

import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.cases import sampled
from pneucli.cli.docs import replace_between_marks
from tests.plausibility.faulty_data_sets import SETS, looked_at, told
from tests.plausibility.worlds import FIXTURES, RATES, at_rate, read, world_pipelines

PAGE = Path(__file__).parents[1] / "docs" / "data-checks.md"
SAMPLE = 8  # pipelines of a world
Alarms = Counter[tuple[str, str]]


def false_alarms(paths: Sequence[Path], rates: Sequence[float]) -> tuple[int, Alarms]:
    """Return the number of recordings, at all rates, and the alarms in them."""
    recordings, alarms = 0, Alarms()
    for path in paths:
        bench = read(path)
        for one in [bench, *(at_rate(bench, rate) for rate in rates)]:
            recordings += len(one.recordings)
            alarms += one.alarms()
    return recordings, alarms


def power(names: Sequence[str]) -> dict[str, tuple[int, int]]:
    """Return, by guard, in how many of its false data sets it speaks, and how many there are."""
    counts: dict[str, tuple[int, int]] = {}
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            spoke = told(looked_at(SETS[name].make(noise=True), Path(folder)))
        for guard, signal in SETS[name].expected:
            found, of = counts.get(guard, (0, 0))
            counts[guard] = (found + ((guard, signal) in spoke), of + 1)
    return counts


def table(worlds: dict[str, tuple[int, Alarms]], found: dict[str, tuple[int, int]]) -> Iterator[str]:
    """Yield the lines of the table in Markdown."""
    yield "| guard | " + " | ".join(f"{world} ({count})" for world, (count, _) in worlds.items()) + " | power |"
    yield "| --- |" + " ---: |" * (len(worlds) + 1)
    guards = sorted({*found, *(guard for _, alarms in worlds.values() for guard, _ in alarms)})
    for guard in guards:
        counts = [(alarms[guard, "contradiction"], alarms[guard, "doubt"]) for _, alarms in worlds.values()]
        cells = [f"{false}/{doubts}" if false or doubts else "" for false, doubts in counts]
        hits, of = found.get(guard, (0, 0))
        yield f"| `{guard}` | {' | '.join(cells)} | {f'{hits} of {of}' if of else ''} |"


def main(arguments: list[str]) -> None:
    """Print the table."""
    if "--small" in arguments:
        small = [path for path in FIXTURES if path.parent.name == "valve_null"]
        print("\n".join(table({"valve_null": false_alarms(small, ())}, power([*SETS][:1]))))
        return
    pipelines = world_pipelines()
    if folders := [Path(one) for one in arguments if not one.startswith("--")]:
        pipelines["exam"] = sorted(path for folder in folders for path in folder.rglob("pipeline.toml"))
    worlds = {}
    for world, paths in pipelines.items():
        worlds[world] = false_alarms(paths if "--full" in arguments else sampled(paths, SAMPLE), RATES)
        print(f"{world}: {worlds[world][0]} recordings", file=sys.stderr, flush=True)
    made = "\n".join(table(worlds, power([*SETS])))
    if "--write" in arguments:
        PAGE.write_text(replace_between_marks(PAGE.read_text(encoding="utf-8"), "guards", made), encoding="utf-8")
    print(made)


if __name__ == "__main__":
    main(sys.argv[1:])
