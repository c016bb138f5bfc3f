"""Draws of noise that do not depend on a model: kept where they are few, since smoothing them takes longest."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

KEPT = 16 << 20  # bytes, of one recording
Drawn = TypeVar("Drawn")


def kept(
    known: dict[tuple[int, int], list[Drawn]], key: tuple[int, int], drawn: Iterable[Drawn], numbers: int
) -> Iterable[Drawn]:
    """Return what was drawn under a key before, else what is ``drawn`` now, kept if so many ``numbers`` fit."""
    if key in known:
        return known[key]
    return known.setdefault(key, list(drawn)) if 8 * numbers <= KEPT else drawn
