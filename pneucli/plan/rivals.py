"""The hypotheses that a diagnosis leaves open, and the manoeuvre in which two fitted models differ most.

References:
    Hunter, W. G. and Reiner, A. M., Technometrics 7 (1965) 307.

"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.messages.diagnose import Answer, CandidateAnswer
from pneucli.plan.bench import Bench, Manoeuvre, recorded_benches
from pneucli.plan.limits import Limits, limits_of, violations
from pneucli.plan.manoeuvres import candidate_manoeuvres
from pneucli.plan.simulation import simulate_manoeuvre
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model

MIN_SEPARATION = 3.0  # times the noise
COMPARED = ("x", "v", "a", "p1", "p2", "force", "temperature", "flow")  # readings that may differ


@dataclass(frozen=True)
class Discrimination:
    """The separation of two models in a manoeuvre: the rms of their difference in the channel with the largest one."""

    manoeuvre: Manoeuvre
    channel: str
    times_noise: float


MAX_RIVALS = 8  # beside the best model
DECIDED_PROBABILITY = 0.97  # a named effect that is more probable is no longer in question
MIN_PRIOR_ODDS = 0.05  # of a fitted but refused effect: the pooled rate of refused ones is no evidence about one
DECIDED = ("at-bound", "below-resolution", "contradicted-by-reading")  # reasons that better recordings do not lift


@dataclass(frozen=True)
class Rival:
    """One hypothesis beside the best model, which has all named effects.

    Attributes:
        effect: Name of the effect in question.
        present: Whether the hypothesis says that the effect is there.
        probability: The effect's probability by the diagnosis; None where it states none.
        in_place_of: The named effect that it replaces.
    """

    effect: str
    present: bool
    probability: float | None = None
    in_place_of: str | None = None

    @property
    def name(self) -> str:
        """Name of the hypothesis."""
        if not self.present:
            return f"without {self.effect}"
        return self.effect if self.in_place_of is None else f"{self.effect} in place of {self.in_place_of}"

    @property
    def own_probability(self) -> float | None:
        """Probability of the hypothesis by the diagnosis; None where it states none."""
        return self.probability if self.present or self.probability is None else 1.0 - self.probability


def rivals_of_diagnosis(answer: Answer, present: Sequence[str], wanted: Sequence[str] = ()) -> list[Rival]:
    """Return the rivals that the last diagnosis leaves open.

    Args:
        answer: The answer of ``diagnose``.
        present: Names of the effects of the best model.
        wanted: Effects in question; none: those that the diagnosis leaves undecided.

    Returns:
        Up to MAX_RIVALS rivals, the most probable first.
    """
    entries = {c.effect: c for c in answer.candidates}
    probability = {c.effect: c.confidence_alone for c in answer.candidates}
    found: list[tuple[float, Rival]] = []
    for name in answer.missing:
        confidence = entries[name].confidence
        if confidence is not None and confidence < DECIDED_PROBABILITY:
            odds = (1.0 - confidence) / max(confidence, 0.01)
            found.append((odds, Rival(name, False, probability[name])))
        for other in entries[name].indistinguishable_from:
            odds = _odds_of_equivalent(probability[name], probability.get(other))
            found.append((odds, Rival(other, True, probability.get(other), name)))
    taken = {rival.effect for _, rival in found} | {*answer.missing}
    found += [(o, Rival(n, True, probability[n])) for o, n in refused_effects(answer.candidates) if n not in taken]
    if wanted:
        found = [(1.0, rival) for _, rival in found if rival.effect in wanted]
        listed = {rival.effect for _, rival in found}
        found += [(1.0, Rival(n, n not in present, probability.get(n))) for n in wanted if n not in listed]
    return [rival for _, rival in sorted(found, key=lambda one: -one[0])[:MAX_RIVALS]]


def refused_effects(candidates: Sequence[CandidateAnswer]) -> list[tuple[float, str]]:
    """Return the effects that a diagnosis fitted and refused, but that better recordings may show.

    An effect that raises the error of the free run may do so beside an unknown one, and one whose fit returned nothing
    may need another motion. Those come last among effects as probable.

    Args:
        candidates: The entries ``candidates`` of the answer of ``diagnose``.

    Returns:
        Prior odds and name of each, the most probable first.
    """
    rows = []
    for c in candidates:
        if c.parameters and not c.supported and c.reason not in DECIDED:
            probability = c.confidence_alone or 0.0
            odds = max(probability / max(1.0 - probability, 0.01), MIN_PRIOR_ODDS)
            rows.append((odds, c.reason == "vanishes", c.effect))
    return [(odds, name) for odds, _, name in sorted(rows, key=lambda row: (-row[0], row[1]))]


def _odds_of_equivalent(mine: float | None, its: float | None) -> float:
    return 1.0 if not mine or not its else float(np.clip(its / mine, MIN_PRIOR_ODDS, 1.0 / MIN_PRIOR_ODDS))


def most_discriminating_manoeuvre(one: Model, other: Model, experiments: Sequence[Experiment]) -> Discrimination | None:
    """Return the manoeuvre that separates two fitted models most.

    The models are not fitted again, because both were fitted to all recordings.

    Args:
        one: The first model.
        other: The second model.
        experiments: The recordings, whose benches carry the manoeuvre out.

    Returns:
        The manoeuvre; None where no difference exceeds MIN_SEPARATION within the limits of the rig.
    """
    benches = recorded_benches(experiments)
    limits = limits_of(one.rig, benches)
    found = (d for bench in benches for d in _separations(one, other, bench, limits))
    best = max(found, key=lambda d: d.times_noise, default=None)
    return best if best is not None and best.times_noise > MIN_SEPARATION else None


def _separations(one: Model, other: Model, bench: Bench, limits: Limits) -> Iterator[Discrimination]:
    channels = [c for c in COMPARED if c in bench.noise and bench.noise[c].rms > 0.0]
    for manoeuvre in candidate_manoeuvres(bench, limits):
        first, second = (simulate_manoeuvre(manoeuvre, model) for model in (one, other))
        if violations(first, limits, one.rig) or violations(second, limits, one.rig):
            continue
        for channel in channels:
            difference = first.readings[channel] - second.readings[channel]
            times_noise = float(np.sqrt(np.mean(difference**2))) / bench.noise[channel].rms
            if np.isfinite(times_noise):
                yield Discrimination(manoeuvre, channel, times_noise)
