"""The detectors of odd data: one file a detector, found in this folder; those of others by their entry points."""

from __future__ import annotations

from functools import cache

from pneucli import extensions
from pneucli.plausibility.detectors.base import Detector


@cache
def detectors() -> tuple[Detector, ...]:
    """Return all detectors by their places; raises InputError where one of another package cannot be loaded."""
    found = [*extensions.declared(__name__, Detector), *extensions.added(extensions.DETECTORS)]
    return tuple(sorted(found, key=lambda one: one.place))
