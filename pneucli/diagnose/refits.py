"""Refits that need nothing of each other: one after another here, or elsewhere at once, with the same results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pneucli.identify.effects import Signature
from pneucli.physics.declaration import Effect

if TYPE_CHECKING:
    from pneucli.diagnose.trial import Bench, State


@dataclass(frozen=True)
class Refit:
    """A fit from ``state``: with ``effect`` more (from signatures ``ranked``, where known), without, or to the end."""

    kind: Literal["with", "without", "to the end"]
    state: State
    effect: Effect
    ranked: tuple[Signature, ...] | None = None


Refits = Callable[["Bench", Sequence[Refit]], "list[State]"]


def here(bench: Bench, refits: Sequence[Refit]) -> list[State]:
    """Return the states that refits end in, done one after another."""
    return [bench.fitted(one) for one in refits]
