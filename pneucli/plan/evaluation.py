"""Evaluate every candidate manoeuvre of the benches: what it would tell, and whether the best model allows it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.plan.bench import Bench
from pneucli.plan.deviation import DeviationByChannel
from pneucli.plan.information import Information, information, rival_differences
from pneucli.plan.limits import Limits, violations
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.manoeuvres import candidate_manoeuvres, manual_manoeuvres
from pneucli.plan.selection import Evaluated, Refused
from pneucli.plan.simulation import simulate_manoeuvre, synthetic_recording
from pneucli.recording import Rig
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

NOISE_SEED = 4900


@dataclass(frozen=True)
class Comparison:
    """What recordings of a plan will be compared with, and how.

    Attributes:
        best: The best model.
        others: The rivals.
        free: The parameters of the best model that are known only within an interval.
        deviations: Its expected deviation by subsystem and channel.
        horizon: Restart interval of the comparison in s.
        low_pass: Corner in Hz of the comparison's low-pass; None: no filter.
        lags: The best model with each lag that it lacks, at its typical size.
    """

    best: Model
    others: Sequence[Model]
    free: Sequence[FreeParameter]
    deviations: DeviationByChannel
    horizon: float
    low_pass: float | None = None
    lags: Sequence[Model] = ()

    def information(self, manoeuvre: Manoeuvre, seed: int = NOISE_SEED) -> Information | None:
        """Return what a manoeuvre would tell; None where nothing of it is compared."""
        outcome = simulate_manoeuvre(manoeuvre, self.best)
        recording = synthetic_recording(manoeuvre, outcome, "plan", seed)
        best, others, free = self.best, self.others, self.free
        return information(recording, best, others, free, self.deviations, self.horizon, self.low_pass, self.lags)

    def differences(self, manoeuvre: Manoeuvre, seed: int = NOISE_SEED) -> dict[tuple[str, str], Array]:
        """Return the differences (K, n) of the rivals over noise, by title of the subsystem and channel."""
        recording = synthetic_recording(manoeuvre, simulate_manoeuvre(manoeuvre, self.best), "plan", seed)
        return rival_differences(recording, self.best, self.others, self.horizon, self.low_pass)


def evaluate_candidates(
    benches: Iterable[Bench],
    limits: Limits,
    comparison: Comparison,
    rig: Rig,
    progress: Callable[[str, float], None] = lambda _, __: None,
) -> tuple[list[Evaluated], list[Refused]]:
    """Evaluate the manoeuvres of all benches.

    Args:
        benches: The benches.
        limits: The limits of the rig; a manoeuvre that exceeds one with the best model is not evaluated.
        comparison: What it is compared with.
        rig: The rig.
        progress: Called with a text and the share that is done.

    Returns:
        The candidates with their information, those by hand included, and the refused ones.
    """
    everything = [m for b in benches for m in (*candidate_manoeuvres(b, limits), *manual_manoeuvres(b, limits))]
    evaluated, refused = [], []
    for number, manoeuvre in enumerate(everything):
        progress(f"simulating {manoeuvre.kind}", number / len(everything))
        if found := violations(simulate_manoeuvre(manoeuvre, comparison.best), limits, rig):
            refused.append(Refused(manoeuvre, "best model", tuple(found)))
            continue
        told = comparison.information(manoeuvre, NOISE_SEED + number)
        if told is not None and np.isfinite(told.matrix).all():
            evaluated.append(Evaluated(manoeuvre, told))
    return evaluated, refused
