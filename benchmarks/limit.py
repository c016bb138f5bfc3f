"""What could any search name? Exams fitted with their true effects: ``python -m benchmarks.limit EXAM...``

Nothing is searched: each case of an exam that ``pneucli exam`` wrote is fitted with the effects that it hides, and each
of these is judged in its place beside the others, as a diagnosis does. An effect that is not likely even so explains
too little of what the recordings show: no search that keeps to this law names it.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks import small
from benchmarks.cases import study_of, truths
from pneucli.diagnose.adequacy import significant_lack_of_fit
from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY, probability
from pneucli.diagnose.data import DiagnosisData, lack_of_fit
from pneucli.diagnose.decision import collect_evidence
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.free_run_error import FreeRunErrors
from pneucli.diagnose.free_run_test import free_run_lack_of_fit
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.model_fit import fit_model, fit_with_effect
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.physics.effects import catalogue

LIKELY = 0.9


class Row(NamedTuple):
    """One true effect: of which case, how likely it is by what its recordings show, and what it leaves in its place."""

    case: str
    effect: str
    likely: float
    left: float


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


def rows(case: Path, truth: dict) -> Iterator[Row]:  # type: ignore[type-arg]
    """Yield the true effects of one case."""
    with tempfile.TemporaryDirectory() as out:
        study = study_of(case, Path(out), MAX_SAMPLES)
        train, test = (study.residual_models(use) for use in ("train", "test"))
        guess = guess_base_model([v.experiment for v in train], study.rig, study.valve)
        bench = DiagnosisData(
            train,
            test,
            catalogue(),
            modelled_parts=guess.valve.covers,
            free_run_errors=FreeRunErrors(study.experiments),
        )
        base = fit_model(guess, train, study.effects)
        names = [n for n in truth["hidden"] if bench.is_observable(catalogue()[n])]
        last = bench.fitted_model(fitted(bench, base, names))
        left = significant_lack_of_fit(*lack_of_fit(bench, last)) or free_run_lack_of_fit(last.model, [*train, *test])
        for effect in (catalogue()[n] for n in names):
            (before,) = bench.refit_without(last, [effect])
            place = Term(bench.candidate(before, last, effect), ())
            found = collect_evidence(bench, last, place.candidate, place, complete=not left)
            yield Row(case.name, effect.name, probability(found), found.left)


def main(arguments: list[str]) -> None:
    """Fit every case that hides effects, and print what could be named."""
    if small.SMALL in arguments:
        with tempfile.TemporaryDirectory() as folder:
            table([small.exam(Path(folder))])
    else:
        table([Path(name) for name in arguments])


def table(exams: list[Path]) -> None:
    """Print what could be named in the cases of the exams."""
    seen: list[Row] = []
    for exam in exams:
        for case, truth in truths(exam):
            if truth["hidden"]:
                seen += rows(case, truth)
                print(case.name, len(seen), file=sys.stderr, flush=True)
    for row in sorted(seen, key=lambda r: r.likely):
        print(f"{row.case} {row.effect}: likely {row.likely:.2f}, leaves {row.left:.2f}")
    cases = {r.case: [o.likely for o in seen if o.case == r.case] for r in seen}
    named = sum(min(of_case) >= MIN_NAMED_PROBABILITY for of_case in cases.values())
    print(
        f"{sum(r.likely >= MIN_NAMED_PROBABILITY for r in seen)} of {len(seen)} effects are likely, "
        f"{sum(r.likely >= LIKELY for r in seen)} with {LIKELY:g} or more; all effects of {named} of {len(cases)} cases"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
