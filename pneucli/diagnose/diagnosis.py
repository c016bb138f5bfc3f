"""The diagnosis as a whole: verdict, effects, sets that the data cannot split, and what to measure next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pneucli.diagnose.detectable import Detectable, detectable
from pneucli.diagnose.remainder import Remainder, too_much
from pneucli.diagnose.replay import astray
from pneucli.diagnose.search import Search, as_good, remains, search
from pneucli.diagnose.stand_ins import stands
from pneucli.diagnose.trial import Bench, State, Trial
from pneucli.diagnose.unknown import Unknown, describe
from pneucli.identify.fit import Estimate, Fit
from pneucli.physics.declaration import Effect

Verdict = Literal["adequate", "missing-effect", "unexplained"]

SLIGHTLY = 0.05  # of the cost, and of what an effect takes of it
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
    """

    verdict: Verdict
    missing: tuple[str, ...]
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
    steps = zip(found.added, found.rungs, found.rungs[1:], strict=False)
    missing = [
        name for name, before, after in steps if not left or stands(bench, found.last, left, name, before, after)
    ]
    equals = {
        n: tuple(t.effect.name for t in found.rivals.get(n, ()) if equal(t, found.last, noise_alone=not left))
        for n in missing
    }
    verdict: Verdict = "unexplained" if left else "missing-effect" if missing else "adequate"
    unknown = unknown_of(bench, found, left, named=bool(missing)) if left else None
    moved = tuple(_moved(start.fit, found.last.fit))
    return Diagnosis(verdict, tuple(missing), equals, found, moved, tuple(detectable(bench, found.last)), unknown)


def equal(rival: Trial, best: State, *, noise_alone: bool) -> bool:
    """Whether the data cannot tell an effect's rival from it.

    It costs no more for certain; or, where noise alone is left, so little more that what is known of the noise and of
    the state at each restart does not decide.
    """
    more, gained = rival.state.cost - best.cost, rival.train.total + rival.test.total
    slight = more < SLIGHTLY * min(best.cost, gained + more)
    return as_good(rival.state, best) or (noise_alone and slight)


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
