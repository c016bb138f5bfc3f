"""Errors that a user can mend, and the exit code each leads to."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass
class InputError(Exception):
    """The input is at fault: where, what was found, what was wanted, and the mend (exit code 2).

    ``where`` names file and, as far as known, line, column or key (``"rig.toml, key rig.vessel.volume"``).
    """

    where: str
    found: str
    wanted: str = ""
    mend: str = ""

    exit_code = 2

    def __str__(self) -> str:
        parts = [f"{self.where}: {self.found}"]
        if self.wanted:
            parts.append(f"wanted: {self.wanted}")
        if self.mend:
            parts.append(f"mend: {self.mend}")
        return "\n  ".join(parts)


class UnitError(ValueError):
    """A unit or quantity string that cannot be read; the door (config, ingest) turns it into an InputError."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ``'did you mean "x"?'`` for the closest of ``known``, or the whole list where none is close."""
    known = sorted(known)
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f'did you mean "{close[0]}"?' if close else f"known: {', '.join(known)}"
