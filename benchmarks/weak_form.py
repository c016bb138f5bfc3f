"""The weak form in place of the screen's simulations: ``python -m benchmarks.weak_form FOLDER...``

FOLDER is an exam that ``pneucli exam`` wrote, or holds cases of a rig by other hands. The given model is fitted to each
case, and the effects that it lacks are ranked as in the first round of a diagnosis. A row for each true effect says
whether the diagnosis would refit it, and has its rank by the screen and by the weak form, and the start that each gives
for its first parameter, over the truth. "Alike" counts effects that its declaration calls similar.

In the weak form the pressures start again from the readings after each window and take one step a sample; the change by
an effect is regressed on the residual, integrated over windows, with the changes by the free parameters projected out.
Balances of forces are along the readings in both. :mod:`benchmarks.cost` prints the screen's share of a diagnosis.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import small
from benchmarks.cases import study_of
from benchmarks.truths import truth_of, truths
from pneucli.diagnose.cross_validation import folds_of
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.score import FittedModel
from pneucli.diagnose.screening import MIN_CHI2, score_test_screen
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.identify.estimation.least_squares import pseudo_inverse
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.estimation.objective import LeastSquaresProblem, in_noise_units
from pneucli.identify.estimation.score_test import ScoreTest, initial_guesses, scaled_initial_guess
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.physics.sides import declared_name
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, parameter_value, with_effect
from pneucli.simulate.rig_quantities import rig_quantities

Array = NDArray[np.float64]

WINDOWS = (0.02, 0.1)  # s

Ranked = dict[str, ScoreTest]  # by effect, the most promising first


class Windows(Experiment):
    """An experiment that restarts from the readings after each window, and takes one step a sample."""

    @property
    def max_step(self) -> float:
        return 1.01 * self.recording.period


def windowed(m: ResidualModel, window: float) -> ResidualModel:
    """Return a residual model in windows; balances of forces are along the readings as they are."""
    e = m.experiment
    restarts = np.union1d(window_starts(e, window), e.restarts)
    values = {f.name: getattr(e, f.name) for f in fields(e)} | {"restarts": restarts}
    return replace(m, experiment=Windows(**values)) if m.is_simulated else m


def window_starts(e: Experiment, window: float) -> NDArray[np.int64]:
    return np.arange(0, e.time.size, max(round(window / e.recording.period), 2))


class WeakForm:
    """The residuals of a fitted model, integrated over windows, without what its free parameters can change."""

    def __init__(self, data: DiagnosisData, fitted: FittedModel, window: float) -> None:
        self.model, self.free, self.window = fitted.model, fitted.fit.free, window
        self.models = [windowed(m, window) for m in data.train]
        self.rows = [in_noise_units(m, m.residual(self.model, {})) for m in self.models]
        problem = LeastSquaresProblem(self.model, self.models, self.free, [{} for _ in self.models])
        z = np.array([f.to_coordinate(parameter_value(self.model, f.name)) for f in self.free])
        columns = [np.zeros(0)]
        for j, f in enumerate(self.free):
            step = f.step if z[j] + f.step < problem.bounds()[1][j] else -f.step
            shifted = problem.model_at(z + step * np.eye(z.size)[j])
            changed = [m.differs(self.model, shifted) for m in self.models]
            columns.append(np.concatenate(self.change(shifted, changed)) / step)
        self.jacobian = np.array(columns[1:]).reshape(z.size, -1).T
        self.inverse = pseudo_inverse(self.jacobian.T @ self.jacobian)
        self.target = self.projected(np.concatenate(list(map(self.integrated, self.models, self.rows))))

    def integrated(self, m: ResidualModel, residual: Array) -> Array:
        """Return the sums over windows of all channels of a residual (N,), over the root of the window."""
        starts, channels = window_starts(m.experiment, self.window), residual.reshape(len(m.channels), -1)
        return np.asarray(
            np.add.reduceat(channels, starts, axis=1).ravel() / math.sqrt(channels.shape[1] / starts.size)
        )

    def change(self, to: Model, changed: Sequence[bool]) -> list[Array]:
        """Return the change of each integrated residual from the fitted model to another one."""
        return [
            self.integrated(m, in_noise_units(m, m.residual(to, {})) - now if is_changed else np.zeros_like(now))
            for m, now, is_changed in zip(self.models, self.rows, changed, strict=True)
        ]

    def projected(self, change: Array) -> Array:
        """Return the part of a change (M,) that no free parameter can reproduce."""
        return np.asarray(change - self.jacobian @ (self.inverse @ (self.jacobian.T @ change)))

    def test(self, effect: Effect, values: dict[str, float]) -> tuple[float, ScoreTest]:
        """Return the gain of an effect over the cost of the residual models that it influences, and its test."""
        changed = [m.is_sensitive_to(effect) for m in self.models]
        parts = self.change(with_effect(self.model, effect, values), changed)
        own = np.repeat(changed, [part.size for part in parts])
        new = self.projected(np.concatenate(parts))
        power, cost = float(new @ new), float(self.target[own] @ self.target[own])
        if not (power > 0.0 and math.isfinite(power)):
            return 0.0, ScoreTest(values, 0.0, 0.0, math.inf)
        step = -float(new @ self.target) / power if effect.in_model_with(self.model.effects).nested else 1.0
        gain = -step * float(new @ (2.0 * self.target + step * new))
        return gain / cost, ScoreTest(values, gain, step, math.inf)


def weak_tests(data: DiagnosisData, fitted: FittedModel, window: float) -> Ranked:
    """Return the best test of each absent effect by the weak form, in the order of their shares."""
    form, facts = WeakForm(data, fitted, window), rig_quantities(fitted.model, [m.experiment for m in data.train])
    best = []
    for effect in data.absent_effects(fitted.model):
        guesses = initial_guesses(effect, facts, fitted.model.rig.priors)
        if guesses:
            best.append((effect.name, max((form.test(effect, values) for values in guesses), key=lambda t: t[0])))
    best.sort(key=lambda one: -one[1][0])
    return {name: test for name, (_, test) in best if test.gain > MIN_CHI2}


class Screened(NamedTuple):
    """The first round of a diagnosis: data, given model, tests by the screen, names to be refitted, seconds."""

    data: DiagnosisData
    fitted: FittedModel
    tests: Ranked
    refitted: frozenset[str]
    seconds: float


def first_round(case: Path) -> Screened:
    """Fit the given model to a case, and screen the effects that it lacks, as a diagnosis does."""
    with tempfile.TemporaryDirectory() as out:
        study = study_of(case, Path(out), MAX_SAMPLES)
        train, test = (study.residual_models(use) for use in ("train", "test"))
    guess = guess_base_model([m.experiment for m in train], study.rig, study.valve)
    folds = () if test else folds_of(train)
    data = DiagnosisData(train, test, study.available_effects, modelled_parts=guess.valve.covers, folds=folds)
    fitted = data.fitted_model(fit_model(guess, train, study.effects))
    begun = time.process_time()
    screened = data.ranked_signatures(fitted)
    seconds = time.process_time() - begun
    share = {e.name: tests[0].gain / max(data.sensitive_cost(fitted, e)[0], 1e-300) for e, tests in screened}
    ranked = sorted(screened, key=lambda one: -share[one[0].name])
    refitted = frozenset(declared_name(e.name) for e, _ in score_test_screen(data, fitted, screened))
    return Screened(data, fitted, {e.name: t[0] for e, t in ranked if t[0].gain > MIN_CHI2}, refitted, seconds)


def rank(tests: Ranked, names: set[str]) -> int:
    """Return the rank of the first of some effects, each counted once for both sides; 0 where none is ranked."""
    order = list(dict.fromkeys(map(declared_name, tests)))
    return next((i for i, name in enumerate(order, 1) if name in names), 0)


class Row(NamedTuple):
    """One true effect: whether it, and it or one alike, was refitted; by each way its two ranks, and the start."""

    refitted: tuple[bool, bool]
    ranks: tuple[tuple[int, int], ...]
    starts: tuple[float, ...]

    def cells(self) -> list[str]:
        """Return the cells of a table."""
        refitted = "yes" if self.refitted[0] else "one alike" if self.refitted[1] else "no"
        starts = ", ".join("-" if math.isnan(start) else f"{start:.2f}" for start in self.starts)
        return [refitted, *("{}, {}".format(*pair) for pair in self.ranks), starts]


def row(effect: Effect, known: Mapping[str, float], first: Screened, ways: Sequence[Ranked]) -> Row:
    """Return the row of a true effect whose parameters are known, from rankings at the given model."""
    model, p = first.fitted.model, effect.main_parameters[0].name
    own = {declared_name(effect.name)}
    alike = own | {*effect.twins}
    facts = rig_quantities(model, [m.experiment for m in first.data.train])

    def start(tests: Ranked) -> float:
        if effect.name not in tests or not known.get(p):
            return math.nan
        return scaled_initial_guess(effect, tests[effect.name], model, facts)[f"{effect.name}.{p}"] / known[p]

    ranks = tuple((rank(tests, own), rank(tests, alike)) for tests in ways)
    return Row((bool(own & first.refitted), bool(alike & first.refitted)), ranks, tuple(map(start, ways)))


def print_ranks(folders: list[Path]) -> None:
    """Print a row for each true effect, and the counts."""
    names = ["screen", *(f"windows of {1e3 * window:.0f} ms" for window in WINDOWS)]
    head = ["case", "samples", "effect", "refitted", *(f"{name}: rank, or alike" for name in names)]
    head += ["starts over truth", "seconds"]
    print(f"| {' | '.join(head)} |\n|{' --- |' * len(head)}")
    seen, seconds = list[Row](), list[list[float]]()
    for case, truth in (one for folder in folders for one in truths(folder)):
        first = first_round(case)
        ways, spent = [first.tests], [first.seconds]
        for window in WINDOWS:
            begun = time.process_time()
            ways.append(weak_tests(first.data, first.fitted, window))
            spent.append(time.process_time() - begun)
        seconds.append(spent)
        known = truth.get("parameters") or (truth["hidden"] if isinstance(truth["hidden"], dict) else {})
        hidden = sorted(truth_of(truth).hidden)
        samples = sum(m.experiment.time.size for m in first.data.train)
        for name in hidden or [""]:
            effect, cells = first.data.effects.get(name), [""] * (3 + len(WINDOWS))
            if effect is not None:
                seen.append(row(effect, known.get(name, {}), first, ways))
                cells = seen[-1].cells()
            times = ", ".join(f"{one:.2f}" for one in spent)
            title = f"{case.parent.name} {case.name} | {samples} | {name}"
            print(f"| {title} | {' | '.join(cells)} | {times} |", flush=True)
    print(
        f"\n{len(seen)} effects, {sum(r.refitted[0] for r in seen)} refitted ({sum(r.refitted[1] for r in seen)} alike)"
    )
    for i, name in enumerate(names):
        firsts = [sum(r.ranks[i][j] == 1 for r in seen) for j in range(2)]
        mean, ratio = np.mean([one[i] for one in seconds]), np.median([one[i] / one[0] for one in seconds])
        print(f"{name}: first {firsts[0]} (or alike {firsts[1]}), {mean:.2f} s, {ratio:.2f} of the screen (median)")


def main(arguments: list[str]) -> None:
    """Diagnose every case and print the ranks."""
    small.on_folders(arguments, print_ranks)


if __name__ == "__main__":
    main(sys.argv[1:])
