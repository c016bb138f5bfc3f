"""The detectors of odd data: one file a detector, found in this folder; those of others by their entry points."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator
from functools import cache
from importlib import import_module

from pneucli import extensions
from pneucli.plausibility.detectors.base import Detector


@cache
def detectors() -> tuple[Detector, ...]:
    """Return all detectors by their places; raises InputError where one of another package cannot be loaded."""
    return tuple(sorted(_declared(), key=lambda one: one.place))


def _declared() -> Iterator[Detector]:
    for one in pkgutil.iter_modules(__path__, f"{__name__}."):
        yield from (found for found in vars(import_module(one.name)).values() if isinstance(found, Detector))
    yield from map(extensions.load, extensions.entry_points(extensions.DETECTORS).values())
