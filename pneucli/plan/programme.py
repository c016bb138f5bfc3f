"""A programme of recordings: manoeuvres drawn from the benches' lists, as varied as the machine time allows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import zip_longest

import numpy as np

from pneucli.plan.manoeuvre import Manoeuvre

CHANGE_OVER_TIME = 2.0  # s of machine time between two manoeuvres, to save a file and start the next
TEST_EVERY = 3  # of the recordings of a bench one is held out: the diagnosis confirms an effect by it


def cost_of(manoeuvre: Manoeuvre) -> float:
    """Return the machine time in s that a manoeuvre takes."""
    return manoeuvre.duration + CHANGE_OVER_TIME


def draw_programme(
    listed: Sequence[Manoeuvre],
    seconds: float,
    is_safe: Callable[[Manoeuvre], bool],
    seed: int,
    by_hand: Sequence[Manoeuvre] = (),
) -> list[Manoeuvre]:
    """Draw manoeuvres until the machine time is used.

    The benches take turns, and on each bench the kinds of manoeuvre: none comes again before every other has come, with
    another amplitude, speed, frequency or place.

    Args:
        listed: What the benches can do.
        seconds: Machine time in s.
        is_safe: Whether a manoeuvre keeps all limits; asked only of what fits into the time.
        seed: Seed of the draw: the same one gives the same programme.
        by_hand: Manoeuvres by hand that are known to keep the limits; they are part of the programme and fitted.

    Returns:
        The manoeuvres, one setup after another, those by hand last on each; one of three on each bench is held out, of
        one alone its repetition.
    """
    left = seconds - sum(map(cost_of, by_hand))
    drawn: list[Manoeuvre] = []
    for one in _in_turn(listed, np.random.default_rng(seed)):
        if cost_of(one) <= left and is_safe(one):
            drawn.append(one)
            left -= cost_of(one)
    uses: dict[str, int] = {}
    for i, one in enumerate(drawn):
        uses[one.bench.name] = uses.get(one.bench.name, 0) + 1
        if uses[one.bench.name] % TEST_EVERY == 2:
            drawn[i] = replace(one, use="test")
    for one in [one for one in drawn if uses[one.bench.name] == 1]:
        if cost_of(one) <= left:
            drawn.append(replace(one, use="test"))
            left -= cost_of(one)
    setups = list(dict.fromkeys(one.bench.setup for one in listed))
    return sorted([*drawn, *by_hand], key=lambda one: setups.index(one.bench.setup))


def _in_turn(listed: Sequence[Manoeuvre], rng: np.random.Generator) -> Iterator[Manoeuvre]:
    """Yield manoeuvres in random order; the benches take turns, and on each its kinds of manoeuvre."""
    kinds: dict[str, dict[tuple[object, ...], list[Manoeuvre]]] = {}
    for one in (listed[i] for i in rng.permutation(len(listed))):
        kinds.setdefault(one.bench.name, {}).setdefault((*one.bench.setup, one.kind), []).append(one)
    queues = [(one for turn in zip_longest(*of_bench.values()) for one in turn if one) for of_bench in kinds.values()]
    yield from (one for turn in zip_longest(*queues) for one in turn if one)
