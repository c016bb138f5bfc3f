"""Progress of a fit: each iteration of each search, as it happens."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple


class Iteration(NamedTuple):
    """One iteration: the effects of the fitted model, the number of search and iteration, and the rms residual.

    The residual is in units of the noise, over all channels and priors.
    """

    effects: tuple[str, ...]
    search: int
    round: int
    residual: float


_observer: ContextVar[Callable[[Iteration], None] | None] = ContextVar("watcher", default=None)
_search_count: ContextVar[int] = ContextVar("searches", default=0)


@contextmanager
def report_iterations_to(observer: Callable[[Iteration], None]) -> Iterator[None]:
    """Call an observer at each iteration of the fits in this thread, for as long as the context lasts.

    Args:
        observer: The function to call.

    """
    tokens = _observer.set(observer), _search_count.set(0)
    try:
        yield
    finally:
        _observer.reset(tokens[0])
        _search_count.reset(tokens[1])


def iteration_callback(effects: Sequence[str], residuals: int) -> Callable[[float], None]:
    """Start a search and return the callback that reports its iterations.

    Args:
        effects: Names of the model's effects.
        residuals: Number of residuals.

    Returns:
        The function to call with the sum of squares, first before the first iteration.

    """
    observer = _observer.get()
    if observer is None:
        return lambda cost: None
    search = _search_count.get() + 1
    _search_count.set(search)
    iterations = iter(range(1_000_000))

    def report(cost: float) -> None:
        observer(Iteration(tuple(effects), search, next(iterations), math.sqrt(cost / max(residuals, 1))))

    return report
