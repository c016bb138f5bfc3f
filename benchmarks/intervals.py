"""How often 95 % intervals hold the truth where a model has the right effects: ``python -m benchmarks.intervals EXAM``

More exams may follow; each is a folder that ``pneucli exam`` wrote. Every case is fitted with its true effects, as
``diagnose`` fits; those that hide an effect outside the catalogue are left out. Rows: with small unknown effects or
without, intervals from blocks of time alone and as they are told (:mod:`pneucli.identify.estimation.intervals`).
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks import small
from benchmarks.cases import study_of, truths
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.physics.effects import catalogue


class Row(NamedTuple):
    """One interval: what acts besides, how it was made, whether it holds the truth, its width over the truth."""

    messy: bool
    made: str
    held: bool
    width: float


def rows(case: Path, truth: dict) -> Iterator[Row]:  # type: ignore[type-arg]
    """Yield the intervals of one case: friction and what was hidden."""
    known = {f"friction.{n}": v for n, v in truth["base"].items() if n in ("coulomb", "viscous")}
    known |= {f"{e}.{n}": v for e, values in truth["hidden"].items() for n, v in values.items()}
    with tempfile.TemporaryDirectory() as out:
        study = study_of(case, Path(out))
        views = study.residual_models("train")
        guess = guess_base_model([v.experiment for v in views], study.rig, study.valve)
        names = dict.fromkeys((*truth["baseline"], *truth["hidden"]))
        found = fit_model(guess, views, tuple(catalogue()[n] for n in names))
    for made, fit in (("blocks of time", found), ("groups of signals too", with_intervals(found, views))):
        for e in fit.estimates:
            if e.name in known and not e.at_bound:
                (low, high), true = e.ci95, known[e.name]
                yield Row(bool(truth["mess"]), made, low <= true <= high, (high - low) / abs(true))


def main(arguments: list[str]) -> None:
    """Fit every case and print the shares."""
    if small.SMALL in arguments:
        with tempfile.TemporaryDirectory() as folder:
            table([small.exam(Path(folder))])
    else:
        table([Path(name) for name in arguments])


def table(exams: list[Path]) -> None:
    """Print the shares over all cases of the exams."""
    seen: list[Row] = []
    for exam in exams:
        for case, truth in truths(exam):
            if truth["outside_the_catalogue"] is None or truth["mess"]:
                seen += rows(case, truth)
                print(case.name, len(seen), file=sys.stderr, flush=True)
    print("| rigs | from | intervals | hold the truth | median width |\n| --- | --- | --- | --- | --- |")
    for messy, made in dict.fromkeys((r.messy, r.made) for r in seen):
        mine = [r for r in seen if (r.messy, r.made) == (messy, made)]
        held, width = np.mean([r.held for r in mine]), np.median([r.width for r in mine])
        rigs = "with small unknown effects" if messy else "clean"
        print(f"| {rigs} | {made} | {len(mine)} | {100 * held:.0f} % | {100 * width:.2g} % |")


if __name__ == "__main__":
    main(sys.argv[1:])
