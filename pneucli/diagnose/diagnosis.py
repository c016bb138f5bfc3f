"""The diagnosis as a whole: verdict, effects, sets that the data cannot split, and what to measure next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pneucli.diagnose.decision import Decision
from pneucli.diagnose.detectable import Detectable, cannot_show, detectable
from pneucli.diagnose.equals import equal
from pneucli.diagnose.remainder import Remainder, too_much
from pneucli.diagnose.replay import astray
from pneucli.diagnose.search import Search, remains, search
from pneucli.diagnose.stand_ins import beside
from pneucli.diagnose.trial import Bench
from pneucli.diagnose.unknown import Unknown, describe
from pneucli.identify.fit import Estimate, Fit
from pneucli.physics.declaration import Effect

Verdict = Literal["adequate", "missing-effect", "unexplained"]

MOVED = 0.2  # of a base parameter's value, beyond its interval


@dataclass(frozen=True)
class Moved:
    """A base parameter that the found effects moved; not plausible where it left its bounds."""

    parameter: str
    before: float
    after: float
    unit: str
    plausible: bool


@dataclass(frozen=True)
class Diagnosis:
    """What the recordings say, and what they cannot say.

    ``missing`` in the order to add them; ``equals`` names for each what explains these recordings equally well.
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


def diagnose(bench: Bench, base: Fit) -> Diagnosis:
    """Find which effects are missing in a fitted model."""
    start = bench.state(base)
    found = search(bench, start)
    left = too_much(found.train, found.test) or astray(found.last.model, [*bench.train, *bench.held_out])
    added = [_added(bench, found, left, i) for i in range(len(found.added))]
    missing = [d.effect.name for d in added if d.supported]
    twins = {n: [t for t in found.rivals.get(n, ()) if equal(t, found.last, noise_alone=not left)] for n in missing}
    equals = {n: tuple(t.effect.name for t in trials) for n, trials in twins.items()}
    alike = [Decision(t.effect, "supported", t) for trials in twins.values() for t in trials]
    sizes = detectable(bench, found.last)
    decisions = _one_each([*added, *alike, *found.decisions, *cannot_show(bench, sizes)])
    verdict: Verdict = "unexplained" if left else "missing-effect" if missing else "adequate"
    unknown = unknown_of(bench, found, left, named=bool(missing)) if left else None
    moved = tuple(_moved(start.fit, found.last.fit))
    return Diagnosis(verdict, tuple(missing), decisions, equals, found, moved, tuple(sizes), unknown)


def _added(bench: Bench, found: Search, left: Sequence[Remainder], i: int) -> Decision:
    """Return the decision about the i-th effect that was added: it stands, or stands in for what is left."""
    trial = bench.trial(found.rungs[i], found.rungs[i + 1], bench.effects[found.added[i]])
    return Decision(trial.effect, beside(bench, found.last, left, trial) if left else "supported", trial)


def _one_each(decisions: Sequence[Decision]) -> tuple[Decision, ...]:
    """Return the first decision about each effect, those that a fit can prove before those that a screen left out."""
    first: dict[str, Decision] = {}
    for d in sorted(decisions, key=lambda d: d.reason == "not-promising"):
        first.setdefault(d.effect.name, d)
    return tuple(first.values())


def unknown_of(bench: Bench, found: Search, left: Sequence[Remainder], *, named: bool) -> Unknown:
    """Describe what the last rung leaves over (``left``); where nothing is named, what the first one does."""
    state = found.last if named else found.rungs[0]
    worst = left if state is found.last else too_much(*remains(bench, state)) or left
    return describe(state.model, [*bench.train, *bench.held_out], worst[0])


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
