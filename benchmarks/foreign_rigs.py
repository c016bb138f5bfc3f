"""How does the diagnosis do on rigs by other hands? ``python -m benchmarks.foreign_rigs OUT FOLDER...``

Each folder holds cases: folders with ``pipeline.toml`` and ``truth.json`` (``hidden``: effects of the catalogue;
``unknown``: others; ``parameters``: the true ones, by effect). Every case is diagnosed by the program's own command,
one at a time; an answer that stands below OUT is not asked for again. A table by folder is printed: effects in the
answer (named, or in the equivalence class of a named one), cases that are exactly right, false names, mild names (of
what the rig always has a little of: ``background`` and ``present_small``), nulls with nothing named, parameters within
15 %, intervals that hold the truth, exit codes 3, seconds a case.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from benchmarks import small

CLOSE = 0.15  # of the true value
CATALOGUE_NAMES = {"rod-seal-leak": "chamber-leak:2"}  # of effects that an author counts as unknown
TIMEOUT = 1800  # s a case
FIXTURE = Path(__file__).parents[1] / "fixtures" / "valve_null"


@dataclass
class Score:
    """Counts of one case, or of several added up."""

    cases: int = 0
    effects: int = 0
    found: int = 0
    exact: int = 0
    false: int = 0
    mild: int = 0
    nulls: int = 0
    silent: int = 0
    parameters: int = 0
    close: int = 0
    covered: int = 0
    faults: int = 0
    seconds: float = 0.0

    def __add__(self, other: Score) -> Score:
        return Score(**{f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(self)})


def answer(case: Path, out: Path) -> tuple[dict[str, Any] | None, float]:
    """Return the program's answer to a case, None where it gave none, and the seconds that it took."""
    kept = out / f"{case.parent.name}-{case.name}.json"
    if not kept.exists():
        begun = time.monotonic()
        command = [sys.executable, "-m", "pneucli", "diagnose", str(case / "pipeline.toml"), "--json", "--quiet"]
        run = subprocess.run(
            [*command, "--out", str(out / kept.stem)], capture_output=True, text=True, timeout=TIMEOUT, check=False
        )
        found = json.loads(run.stdout) if run.returncode == 0 else None
        seconds = time.monotonic() - begun
        kept.write_text(json.dumps({"answer": found, "code": run.returncode, "seconds": seconds}))
    known = json.loads(kept.read_text())
    return known["answer"], known["seconds"]


def mild_names(truth: dict[str, Any]) -> set[str]:
    """Return the effects of which a healthy rig has a little as well."""
    listed = truth.get("background", [])
    return set(truth.get("present_small", {})) | (set(listed) if isinstance(listed, list) else set())


def score(truth: dict[str, Any], found: dict[str, Any] | None, seconds: float) -> Score:
    """Return the counts of one case."""
    known = {CATALOGUE_NAMES[name] for name in truth["unknown"] if name in CATALOGUE_NAMES}
    hidden, null = set(truth["hidden"]) | known, not truth["hidden"] and not truth["unknown"]
    true_values = {CATALOGUE_NAMES.get(name, name): values for name, values in truth["parameters"].items()}
    out = Score(cases=1, effects=len(hidden), nulls=int(null), faults=int(found is None), seconds=seconds)
    if found is None:
        return out
    named = {c["effect"]: c for c in found["candidates"] if c["effect"] in found["missing"]}
    classes = {name: {name, *named.get(name, {}).get("indistinguishable_from", [])} for name in found["missing"]}
    wrong = [name for name, equal in classes.items() if not equal & hidden]
    out.found = len(hidden & {name for equal in classes.values() for name in equal})
    out.mild = sum(name in mild_names(truth) for name in wrong)
    out.false = len(wrong) - out.mild
    out.exact, out.silent = int(set(found["missing"]) == hidden), int(null and not wrong)
    for effect, true in ((e, true_values.get(e, {})) for e in hidden & named.keys()):
        values = named[effect]["parameters"]
        for name, value in ((n, v) for n, v in true.items() if n in values):
            low, high = values[name]["ci95"]
            out.parameters += 1
            out.close += abs(values[name]["value"] - value) <= CLOSE * abs(value)
            out.covered += low <= value <= high
    return out


def row(name: str, s: Score) -> str:
    """Return one row of the table."""
    cells = [name, f"{s.found}/{s.effects}", f"{s.exact}/{s.cases}", s.false, s.mild, f"{s.silent}/{s.nulls}"]
    cells += [
        f"{s.close}/{s.parameters}",
        f"{s.covered}/{s.parameters}",
        s.faults,
        f"{s.seconds / max(s.cases, 1):.0f}",
    ]
    return "| " + " | ".join(map(str, cells)) + " |"


def main(arguments: list[str]) -> None:
    """Diagnose the cases of each folder and print the table."""
    if "--small" in arguments:
        with tempfile.TemporaryDirectory() as folder:
            table(Path(folder) / "out", [small_rig(Path(folder) / "rig")])
    else:
        table(Path(arguments[0]), [Path(one) for one in arguments[1:]])


def small_rig(folder: Path) -> Path:
    """Write one case, a fixture whose rig is healthy; return the folder of the rig."""
    shutil.copytree(FIXTURE, folder / "case-01")
    small.shorten(folder / "case-01" / "pipeline.toml")
    truth = {"hidden": [], "unknown": [], "parameters": {}}
    (folder / "case-01" / "truth.json").write_text(json.dumps(truth))
    return folder


def table(out: Path, folders: Sequence[Path]) -> None:
    """Print a row for each folder of cases."""
    out.mkdir(parents=True, exist_ok=True)
    print("| rig | effect in answer | exactly | false | mild | nulls | within 15 % | interval holds | faults | s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    total = Score()
    for folder in folders:
        mine = Score()
        for path in sorted(folder.glob("*/truth.json")):
            one = score(json.loads(path.read_text()), *answer(path.parent, out))
            print(row(f"{folder.name} {path.parent.name}", one), file=sys.stderr, flush=True)
            mine += one
        print(row(folder.name, mine), flush=True)
        total += mine
    print(row("all", total))


if __name__ == "__main__":
    main(sys.argv[1:])
