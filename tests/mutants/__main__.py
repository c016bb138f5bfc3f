"""``python -m tests.mutants``: put faults into a sample of the code and say which ones the unit tests do not notice."""

import argparse
import os
import random
import sys
import tempfile
import time
from pathlib import Path

from tests.mutants.places import Mutant, sample, shares
from tests.mutants.report import accepted, report, survivor
from tests.mutants.run import ENVIRONMENT, ROOT, TOGETHER, Outcome, contexts, copied, outcomes

PACKAGES = {
    "pneucli/identify": ("tests/identify", "tests/identify_friction", "tests/identify_valve"),
    "pneucli/diagnose": ("tests/diagnose",),
    "pneucli/compare": ("tests/compare",),
    "pneucli/noise": ("tests/noise",),
    "pneucli/controller": ("tests/controller",),
    "pneucli/design": ("tests/design",),
    "pneucli/closed_loop": ("tests/closed_loop",),
    "pneucli/exam": ("tests/exam",),
}
WANTED = 0.85


def main() -> None:
    """Draw, run, report; exit 1 where fewer than WANTED are killed."""
    os.environ.update(ENVIRONMENT)  # before the forks load what reads it
    asked = _arguments()
    print(f"seed {asked.seed}", flush=True)
    began = time.monotonic()
    packages = tuple(p for p in PACKAGES if not asked.package or p.endswith(tuple(asked.package)))
    mutants = [m for m in sample(ROOT, shares(ROOT, packages, asked.number), asked.seed) if asked.file in m.file]
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        first = copied(Path(folder, "0"))
        known = contexts(first, tuple(PACKAGES), [f for p in packages for f in PACKAGES[p]])
        trees = [first, *(copied(Path(folder, str(i)), first) for i in range(1, TOGETHER))]
        found = outcomes(mutants, known, trees, _say)
    print("\n\n" + report(mutants, found, accepted()))
    print(f"{time.monotonic() - began:.0f} s")
    sys.exit(found.count("killed") < WANTED * len(found))


def _say(mutant: Mutant, outcome: Outcome) -> None:
    print("." if outcome == "killed" else f"\n{survivor(mutant, outcome, {})}", end="", flush=True)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6), help="of the sample")
    parser.add_argument("--number", type=int, default=300, help="of mutants")
    parser.add_argument("--package", action="append", help="only this one, such as noise; may be given several times")
    parser.add_argument("--file", default="", help="of the sample only what is in files whose path holds this")
    return parser.parse_args()


if __name__ == "__main__":
    main()
