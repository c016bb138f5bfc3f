"""The detectors of odd data: one file a detector, found in this folder; those of others by their entry points."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

from pneucli import imports
from pneucli.plausibility.rig_check import Finding, RigCheck


@dataclass(frozen=True)
class Detector:
    """A detector of what is odd, or cannot be true, in recordings.

    A file of this folder declares it, or a package of somebody else, as an entry point of the group
    ``pneucli.detectors``.

    Attributes:
        find: Yields findings of all recordings; those of steady benches, whose rows have no clock, are among them only
            where ``steady`` is set.
        says: When each check of its findings is a contradiction, and when a doubt, for the documentation; "" for never.
        steady: Whether it looks at single values, whatever their neighbours are.
        place: Findings are told in the order of places.
    """

    find: Callable[[RigCheck], Iterator[Finding]]
    says: Mapping[str, tuple[str, str]]
    steady: bool = False
    place: int = 100


@cache
def detectors() -> tuple[Detector, ...]:
    """Return all detectors by their places; raises InputError where one of another package cannot be loaded."""
    found = [*imports.declared(__name__, Detector), *imports.added(imports.DETECTORS)]
    return tuple(sorted(found, key=lambda one: one.place))
