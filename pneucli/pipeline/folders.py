"""A stage's folder is the old one or the new one, whole, at every moment at which a run may be killed.

A stage writes into ``.NAME.new``. When it is done, ``NAME`` is renamed to ``.NAME.old``, ``.NAME.new`` to ``NAME``, and
the old one is deleted. :func:`recover`, called under the lock before anything else, puts back an old folder whose
successor has not arrived, and removes what a killed run left behind.
"""

from __future__ import annotations

import shutil
from pathlib import Path


def _new(artifacts: Path, stage: str) -> Path:
    return artifacts / f".{stage}.new"


def _old(artifacts: Path, stage: str) -> Path:
    return artifacts / f".{stage}.old"


def begin(artifacts: Path, stage: str) -> Path:
    """Return the empty folder into which the stage writes."""
    folder = _new(artifacts, stage)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    return folder


def finish(artifacts: Path, stage: str) -> None:
    """Put the new folder in the place of the old one."""
    final, old = artifacts / stage, _old(artifacts, stage)
    if final.exists():
        final.rename(old)
    _new(artifacts, stage).rename(final)
    shutil.rmtree(old, ignore_errors=True)


def recover(artifacts: Path, stage: str) -> None:
    """Make good what a killed run left of ``stage``."""
    final, old = artifacts / stage, _old(artifacts, stage)
    if old.exists() and not final.exists():
        old.rename(final)
    for leftover in (old, _new(artifacts, stage)):
        shutil.rmtree(leftover, ignore_errors=True)
