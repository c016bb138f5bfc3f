"""How often 95 % intervals hold the truth, and how wide they are: ``python -m benchmarks.intervals FOLDER...``

Each folder is an exam that ``pneucli exam`` wrote, or holds cases of a rig by other hands: folders with
``pipeline.toml`` and ``truth.json`` (``parameters``: the true ones by effect; ``true``: Coulomb friction ``Fc`` and
viscous friction ``visc``). Every case is fitted with its true effects, as ``diagnose`` fits; cases with an effect
outside the catalogue are left out. A row for each folder and each kind of interval: from blocks of time alone, and as
they are reported (:mod:`pneucli.identify.estimation.intervals`), of all parameters and of hidden effects alone.

The interval score is that of Gneiting and Raftery (J. Am. Stat. Assoc. 102 (2007) 359): width plus 2 / 0.05 times the
distance by which the truth lies outside, here over the truth; the smaller, the better. Its geometric mean is printed.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks import small
from benchmarks.cases import study_of
from benchmarks.truths import CLOSE, SEALED, truth_of, truths
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.physics.effects import catalogue_with_sides

REPORTED = "as reported"
PENALTY = 2.0 / 0.05  # of an interval's distance from the truth, at 95 %
MAX_SAMPLES = 60_000  # of a case
TRUE_FRICTION = {"Fc": "friction.coulomb", "visc": "friction.viscous"}  # in the truth of a rig by other hands


class Case(NamedTuple):
    """A case: its folder, the effects of its rig, and the true values that are known."""

    folder: Path
    effects: tuple[str, ...]
    known: Mapping[str, float]


class Row(NamedTuple):
    """One interval: the folder of its case, how it was made; over the truth the error of the estimate, the width of the
    interval and its distance from the truth.
    """

    world: str
    made: str
    error: float
    width: float
    distance: float

    @property
    def score(self) -> float:
        """The interval score."""
        return self.width + PENALTY * self.distance


def cases(folder: Path) -> Iterator[Case]:
    """Yield the cases of an exam or of a rig whose effects are all in the catalogue."""
    if (folder / SEALED).is_dir():
        for path, truth in truths(folder):
            if truth["outside_the_catalogue"] is None:
                friction = {f"friction.{n}": v for n, v in truth["base"].items() if n in ("coulomb", "viscous")}
                yield _case(path, truth["baseline"], truth["hidden"], friction)
    for path in sorted(folder.glob("*/truth.json")):
        truth = json.loads(path.read_text())
        if not truth_of(truth).unknown:
            true = truth.get("true") or {}
            true = json.loads(true) if isinstance(true, str) else true
            friction = {name: true[key] for key, name in TRUE_FRICTION.items() if key in true}
            yield _case(path.parent, truth["baseline"], truth_of(truth).parameters, friction)


def _case(folder: Path, baseline: list[str], hidden: Mapping[str, Mapping[str, float]], friction: Any) -> Case:
    known = friction | {f"{e}.{n}": value for e, values in hidden.items() for n, value in values.items()}
    return Case(folder, tuple(dict.fromkeys((*baseline, *hidden))), known)


def rows(world: str, case: Case) -> Iterator[Row]:
    """Yield the intervals of one case."""
    with tempfile.TemporaryDirectory() as out:
        study = study_of(case.folder, Path(out), MAX_SAMPLES)
        views = study.residual_models("train")
        guess = guess_base_model([v.experiment for v in views], study.rig, study.valve)
        found = fit_model(guess, views, tuple(catalogue_with_sides()[name] for name in case.effects))
    fits: dict[str, Fit] = {"blocks of time": found, REPORTED: with_intervals(found, views)}
    for made, fit in fits.items():
        for e in fit.estimates:
            if e.name in case.known and case.known[e.name] and not e.at_bound:
                (low, high), true = e.ci95, case.known[e.name]
                distance = max(low - true, true - high, 0.0)
                row = Row(world, made, *(abs(y / true) for y in (e.value - true, high - low, distance)))
                yield row
                if made == REPORTED and not e.name.startswith("friction."):
                    yield row._replace(made="as reported, of hidden effects")


def main(arguments: list[str]) -> None:
    """Fit every case and print the table."""
    small.on_folders(arguments, table)


def table(folders: list[Path]) -> None:
    """Print coverage, median width and score for each folder."""
    print(
        "| cases | interval | number | hold the truth | within 15 % | median width | score |\n"
        "| --- | --- | --- | --- | --- | --- | --- |"
    )
    for folder in folders:
        seen: list[Row] = []
        for case in cases(folder):
            seen += rows(folder.name, case)
            print(case.folder.name, len(seen), file=sys.stderr, flush=True)
        for made in dict.fromkeys(r.made for r in seen):
            mine = [r for r in seen if r.made == made]
            held, near = (np.mean(of) for of in ([r.distance == 0.0 for r in mine], [r.error <= CLOSE for r in mine]))
            width, score = np.median([r.width for r in mine]), np.exp(np.mean(np.log([r.score for r in mine])))
            shares = f"{100 * held:.0f} % | {100 * near:.0f} % | {100 * width:.2g} %"
            print(f"| {folder.name} | {made} | {len(mine)} | {shares} | {score:.3g} |")


if __name__ == "__main__":
    main(sys.argv[1:])
