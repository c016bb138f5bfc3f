"""What could any search name? Cases fitted with their true effects: ``python -m benchmarks.limit FOLDER...``

A folder is an exam that ``pneucli exam`` wrote, or a rig: folders with ``pipeline.toml`` and ``truth.json``
(:mod:`benchmarks.truths`). Nothing is searched. Each case is fitted with the effects that it hides and those
that the rig always has, and each hidden one is judged in the model with all of them, as a diagnosis does. An effect
that is improbable or violates a hard constraint even so explains too little of what the recordings show: no search
names it under these rules.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks import small
from benchmarks.cases import study_of
from benchmarks.truths import Truth, truth_of, truths
from pneucli.diagnose.candidate import Reason
from pneucli.diagnose.cross_validation import folds_of
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.decision import judge
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.free_run_error import FreeRunErrors
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.model_fit import fit_model, fit_with_effect
from pneucli.identify.guesses.base_model import guess_base_model

CERTAIN = 0.9


class Row(NamedTuple):
    """One true effect of a case: its probability, the remaining variance, and what is decided on it."""

    case: str
    effect: str
    probability: float
    left: float
    reason: Reason

    @property
    def is_nameable(self) -> bool:
        """Whether the rules of the diagnosis would name the effect."""
        return self.reason == "supported"


def fitted(bench: DiagnosisData, base: Fit, names: list[str]) -> Fit:
    """Return the better of the fits with these effects, added in either order."""
    orders = [names, names[::-1]] if len(names) > 1 else [names]
    ends = []
    for order in orders:
        found = base
        for name in order:
            found = fit_with_effect(found, bench.train, bench.effects[name])
        ends.append(found)
    return min(ends, key=lambda f: f.cost)


def rows(case: Path, truth: Truth) -> Iterator[Row]:
    """Yield the true effects of one case."""
    with tempfile.TemporaryDirectory() as out:
        study = study_of(case, Path(out), MAX_SAMPLES)
        train, test = (study.residual_models(use) for use in ("train", "test"))
        guess = guess_base_model([v.experiment for v in train], study.rig, study.valve)
        bench = DiagnosisData(
            train,
            test,
            study.available_effects,
            modelled_parts=guess.valve.covers,
            free_run_errors=FreeRunErrors(study.experiments),
            folds=() if test else folds_of(train),
        )
        base = fit_model(guess, train, study.effects)
        names = [n for n in [*sorted(truth.hidden), *sorted(truth.mild - truth.hidden)] if n in bench.effects]
        names = [
            n for n in names if bench.is_observable(bench.effects[n]) and n not in bench.fitted_model(base).effect_names
        ]
        last = bench.fitted_model(fitted(bench, base, names))
        for effect in (bench.effects[n] for n in names if n in truth.hidden):
            (before,) = bench.refit_without(last, [effect])
            found = judge(bench, Term(bench.candidate(before, last, effect), ()), constrained=True)
            name = f"{case.parent.name} {case.name}"
            yield Row(name, effect.name, found.probability, found.evidence.left, found.decision.reason)


def main(arguments: list[str]) -> None:
    """Fit every case that hides effects, and print what could be named."""
    small.on_folders(arguments, table)


def table(folders: list[Path]) -> None:
    """Print what could be named in the cases of the exams and rigs."""
    seen: list[Row] = []
    for folder in folders:
        for case, truth in truths(folder):
            if truth["hidden"] or truth.get("unknown"):
                seen += rows(case, truth_of(truth))
                print(case.name, len(seen), file=sys.stderr, flush=True)
    for row in sorted(seen, key=lambda r: r.probability):
        refused = "" if row.is_nameable else f", {row.reason}"
        print(f"{row.case} {row.effect}: probability {row.probability:.2f}, leaves {row.left:.2f}{refused}")
    cases = {r.case: [o.is_nameable for o in seen if o.case == r.case] for r in seen}
    print(
        f"{sum(r.is_nameable for r in seen)} of {len(seen)} effects can be named, "
        f"{sum(r.is_nameable and r.probability >= CERTAIN for r in seen)} at {CERTAIN:g} or more; "
        f"all effects of {sum(map(all, cases.values()))} of {len(cases)} cases"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
