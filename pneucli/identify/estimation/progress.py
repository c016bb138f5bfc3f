"""Who wants to see a fit at work: each round of each search, as it is done."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple


class Round(NamedTuple):
    """One round: the effects of the model that is fitted, which search and round of it, and the rms residual.

    The residual is in units of the noise, over all channels, what is known beforehand counted with it.
    """

    effects: tuple[str, ...]
    search: int
    round: int
    residual: float


_watcher: ContextVar[Callable[[Round], None] | None] = ContextVar("watcher", default=None)
_searches: ContextVar[int] = ContextVar("searches", default=0)


@contextmanager
def watching(see: Callable[[Round], None]) -> Iterator[None]:
    """Let ``see`` be told of each round of the fits in this thread, while it lasts."""
    tokens = _watcher.set(see), _searches.set(0)
    try:
        yield
    finally:
        _watcher.reset(tokens[0])
        _searches.reset(tokens[1])


def watched(effects: Sequence[str], residuals: int) -> Callable[[float], None]:
    """Return what a search of so many ``residuals`` calls with its sum of squares, first before its first round."""
    see = _watcher.get()
    if see is None:
        return lambda cost: None
    search = _searches.get() + 1
    _searches.set(search)
    done = iter(range(1_000_000))

    def tell(cost: float) -> None:
        see(Round(tuple(effects), search, next(done), math.sqrt(cost / max(residuals, 1))))

    return tell
