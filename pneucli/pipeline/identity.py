"""What a client and its workers must have in common, so that a result does not depend on who made it."""

from __future__ import annotations

import platform
from importlib.metadata import version

from pneucli.pipeline.staleness import program_digest

PACKAGES = ("numpy", "scipy", "numba")


def identity() -> dict[str, str]:
    """Return by name the versions of this program (with the hash of its source), of Python and of what computes."""
    python = ".".join(platform.python_version_tuple()[:2])
    return {"pneucli": program_digest(), "Python": python, **{name: version(name) for name in PACKAGES}}
