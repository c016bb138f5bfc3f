"""The diagnosis as a whole: verdict, effects, sets that the data cannot split, and what to measure next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import softmax

from pneucli.diagnose.adequacy import Remainder, too_much
from pneucli.diagnose.calibration import Evidence, probability, refused, shares
from pneucli.diagnose.candidate import Decision
from pneucli.diagnose.data import Bench, State, Trial, remains
from pneucli.diagnose.detectability import Detectable, cannot_show, detectable
from pneucli.diagnose.discrepancy import Discrepancy, Unknown, describe, discrepancies
from pneucli.diagnose.equivalence import Place
from pneucli.diagnose.free_run_adequacy import astray
from pneucli.diagnose.posterior import Weighed, evidence_of, examined, standing, weighed, without_refused
from pneucli.diagnose.selection import Search, search
from pneucli.identify.estimation.fit import Estimate, Fit
from pneucli.physics.declaration import Effect

Verdict = Literal["adequate", "missing-effect", "unexplained", "inconclusive"]

BLIND = 0.5  # of the effects that could act: where more would not have shown, nothing is adequate
MOVED = 0.2  # of a base parameter's value, beyond its interval


@dataclass(frozen=True)
class Moved:
    """A base parameter that the found effects moved; not plausible where it left its bounds."""

    parameter: str
    before: float
    after: float
    unit: str
    plausible: bool


class Confidence(NamedTuple):
    """The probability that an effect, or one that the data cannot tell from it, is there; and that it is this one."""

    of_set: float
    alone: float


@dataclass(frozen=True)
class Diagnosis:
    """What the recordings say, and what they cannot say.

    ``missing`` in the order to add them; ``equals`` names for each that was added what explains as much.
    ``decisions``: one for every effect that the model lacked, those that were added first.
    """

    verdict: Verdict
    missing: tuple[str, ...]
    decisions: tuple[Decision, ...]
    equals: Mapping[str, tuple[str, ...]]
    found: Search
    moved: tuple[Moved, ...]
    detectable: tuple[Detectable, ...]
    unknown: Unknown | None
    confidence: Mapping[str, Confidence]
    evidence: Mapping[str, Evidence]
    left: tuple[Discrepancy, ...]


def diagnose(bench: Bench, base: Fit) -> Diagnosis:
    """Find which effects are missing in a fitted model."""
    start = bench.state(base)
    found = search(bench, start)
    left = too_much(found.train, found.test) or astray(found.last.model, [*bench.train, *bench.held_out])
    places = found.places
    twins = {name: place.alike(bench, complete=not left) for name, place in places.items()}
    equals = {name: tuple(t.effect.name for t in twins.get(name, [])) for name in found.added}
    weights = [
        weighed(bench, found.last, t, left, places.get(name), equals[name])
        for name, t in zip(found.added, _trials(bench, found), strict=True)
    ]
    weights = without_refused(bench, found.last, weights, left)
    missing = [d.effect.name for d, _ in weights if d.supported]
    alike = [Decision(t.effect, "supported", t) for name in missing for t in twins.get(name, [])]
    sizes = detectable(bench, found.last)
    decisions = _one_each([*(d for d, _ in weights), *alike, *found.decisions, *cannot_show(bench, sizes)])
    doubted = {t.effect.name: evidence_of(bench, t.state, t, Place(t, ()), complete=False) for t in found.doubted}
    evidence = doubted | {
        d.effect.name: e for d, e in weights if d.reason not in ("cannot-show", "explained-by-signal")
    }
    parts = {n: _parts(bench, places[n], twins[n], complete=not left) for n in missing if n in places}
    sure = _confidence(bench, decisions, evidence, parts)
    shown = found.last if left and missing else found.rungs[_known([d for d, _ in weights])]
    unexplained = left if shown is found.last else _unexplained(bench, shown, weights, left)
    unknown = describe(bench, shown.fit, unexplained[0]) if unexplained else None
    moved = tuple(_moved(start.fit, found.last.fit))
    verdict = _verdict(bench, unexplained, missing, sizes)
    remaining = discrepancies(bench, found.last.fit, [*found.test, *found.train])
    return Diagnosis(
        verdict=verdict,
        missing=tuple(missing),
        decisions=decisions,
        equals=equals,
        found=found,
        moved=moved,
        detectable=tuple(sizes),
        unknown=unknown,
        confidence=sure,
        evidence=evidence,
        left=tuple(remaining),
    )


def _unexplained(
    bench: Bench, shown: State, weights: Sequence[Weighed], left: Sequence[Remainder]
) -> Sequence[Remainder]:
    """Return what a state leaves that is more than noise, worst first, or what the last one did.

    Where a law of a signal explains more than an effect, what that acts in: faint or not, it is sure.
    """
    train, test = remains(bench, shown)
    effects = [d.effect for d, _ in weights if d.reason == "explained-by-signal"]
    kinds = {type(v) for v in bench.train for effect in effects if v.feels(effect)}
    faint = sorted((r for r in train if r.kind in kinds), key=lambda r: -r.ratio)
    return too_much(train, test) or left or faint[:1]


def _verdict(bench: Bench, left: Sequence[Remainder], missing: Sequence[str], sizes: Sequence[Detectable]) -> Verdict:
    if left:
        return "unexplained"
    if missing:
        return "missing-effect"
    blind = sum(not d.typical for d in sizes)
    return "inconclusive" if bench.implausible or blind > BLIND * len(sizes) else "adequate"


def _trials(bench: Bench, found: Search) -> list[Trial]:
    """Return the step to each rung."""
    return [bench.trial(a, b, bench.effects[n]) for n, (a, b) in zip(found.added, pairwise(found.rungs), strict=True)]


def _confidence(
    bench: Bench,
    decisions: Sequence[Decision],
    added: Mapping[str, Evidence],
    parts: Mapping[str, Mapping[str, float]],
) -> dict[str, Confidence]:
    """Return for each effect the probability that it, or one of its twins, is there, and that it is that one.

    ``parts`` are the likelihoods of the named effects and their twins. Nothing is said of effects that only recordings
    show of which there is no exam.
    """
    sure = {d.effect.name: Confidence(*[refused(d.reason)] * 2) for d in decisions if examined(bench, d.effect)}
    known = {name: probability(evidence) for name, evidence in added.items() if name in sure}
    sure |= {name: Confidence(p, p) for name, p in known.items()}
    for name, of_each in parts.items():
        if name in known:
            sure |= {one: Confidence(known[name], part * known[name]) for one, part in of_each.items()}
    return sure


def _parts(bench: Bench, place: Place, alike: Sequence[Trial], *, complete: bool) -> dict[str, float]:
    """Return the likelihood of an effect and of those alike over that of all, by name.

    Beside something unknown squares do not tell: there it is how each stands against the others, one of them being
    there.
    """
    trials = [place.named, *alike]
    parts = shares([t.state for t in trials]) if complete else softmax([standing(bench, t) for t in trials]).tolist()
    return dict(zip([t.effect.name for t in trials], parts, strict=True))


def _one_each(decisions: Sequence[Decision]) -> tuple[Decision, ...]:
    """Return the first decision about each effect, those that a fit can prove before those that a screen left out."""
    first: dict[str, Decision] = {}
    for d in sorted(decisions, key=lambda d: d.reason == "not-promising"):
        first.setdefault(d.effect.name, d)
    return tuple(first.values())


def _known(added: Sequence[Decision]) -> int:
    """Return how many of the effects added are named before the first that is not: what it took is unexplained."""
    return next((i for i, d in enumerate(added) if not d.supported), len(added))


def _moved(before: Fit, after: Fit) -> list[Moved]:
    now = {e.name: e for e in after.estimates}
    return [
        Moved(e.name, e.value, now[e.name].value, e.unit, not now[e.name].at_bound)
        for e in before.estimates
        if e.name in now and _far(e, now[e.name])
    ]


def _far(before: Estimate, after: Estimate) -> bool:
    apart = abs(after.value - before.value)
    return after.at_bound or bool(
        apart > MOVED * abs(before.value) and apart > 2.0 * np.hypot(before.error, after.error)
    )


def how_to_tell(one: Effect, other: Effect) -> str:
    """Return what recording tells two effects apart, as their declarations say."""
    return f"To tell {one.name} from {other.name}: {one.separate}" + (
        f" {other.separate}" if other.separate != one.separate else ""
    )
