"""Who wants to see a fit at work: each round of each search, as it is done."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple


class Iteration(NamedTuple):
    """One round: the effects of the model that is fitted, which search and round of it, and the rms residual.

    The residual is in units of the noise, over all channels, what is known beforehand counted with it.
    """

    effects: tuple[str, ...]
    search: int
    round: int
    residual: float


_observer: ContextVar[Callable[[Iteration], None] | None] = ContextVar("watcher", default=None)
_search_count: ContextVar[int] = ContextVar("searches", default=0)


@contextmanager
def report_iterations_to(observer: Callable[[Iteration], None]) -> Iterator[None]:
    """Let ``observer`` be told of each round of the fits in this thread, while it lasts."""
    tokens = _observer.set(observer), _search_count.set(0)
    try:
        yield
    finally:
        _observer.reset(tokens[0])
        _search_count.reset(tokens[1])


def iteration_callback(effects: Sequence[str], residuals: int) -> Callable[[float], None]:
    """Return what a search of so many ``residuals`` calls with its sum of squares, first before its first round."""
    see = _observer.get()
    if see is None:
        return lambda cost: None
    search = _search_count.get() + 1
    _search_count.set(search)
    done = iter(range(1_000_000))

    def tell(cost: float) -> None:
        see(Iteration(tuple(effects), search, next(done), math.sqrt(cost / max(residuals, 1))))

    return tell
