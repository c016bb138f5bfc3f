"""Errors that a user can mend, and the exit code each leads to; and the one way in which foreign text is shown."""

from __future__ import annotations

import difflib
import errno
import os
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass
class InputError(Exception):
    """The input is at fault: where, what was found, what was wanted, and the mend (exit code 2).

    ``where`` names file and, as far as known, line, column or key (``"rig.toml, key rig.vessel.volume"``). Where one
    file has several faults, ``faults`` are these.
    """

    where: str
    found: str
    wanted: str = ""
    mend: str = ""
    faults: Sequence[InputError] = ()

    exit_code = 2

    def __str__(self) -> str:
        parts = [f"{self.where}: {self.found}"]
        if self.wanted:
            parts.append(f"wanted: {self.wanted}")
        if self.mend:
            parts.append(f"mend: {self.mend}")
        return "\n".join(["\n  ".join(map(printable, parts)), *map(str, self.faults)])


class UnitError(ValueError):
    """A unit or quantity string that cannot be read; the door (config, ingest) turns it into an InputError."""


MAX_LISTED = 40  # of what is known


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """Return ``'did you mean "x"?'`` for the closest of ``choices``, or the list (of the first) where none is close."""
    choices = sorted(choices)
    close = difflib.get_close_matches(word, choices, cutoff=0.6)
    close.sort(key=lambda one: sorted(one) != sorted(word))  # letters that changed places before others
    more = ", ..." * (len(choices) > MAX_LISTED)
    return f'did you mean "{close[0]}"?' if close else f"known: {', '.join(choices[:MAX_LISTED])}{more}"


_INVISIBLE_CATEGORIES = {
    "Cc",
    "Cn",
    "Cs",
    "Zl",
    "Zp",
}  # control, no character, half of a pair (a byte that is no UTF-8), line ends
_DIRECTION_CHANGES = {
    "LRE",
    "RLE",
    "LRO",
    "RLO",
    "PDF",
    "LRI",
    "RLI",
    "FSI",
    "PDI",
}  # what follows is shown in another order


def printable(text: str, keep: str = "") -> str:
    """Return ``text`` with every character that acts and is not seen as its escape, such as that of a line end."""
    if text.isprintable():
        return text
    return "".join(c if c in keep or not _is_invisible(c) else c.encode("unicode_escape").decode("ascii") for c in text)


def _is_invisible(character: str) -> bool:
    return (
        unicodedata.category(character) in _INVISIBLE_CATEGORIES
        or unicodedata.bidirectional(character) in _DIRECTION_CHANGES
    )


_PERMISSION_MEND = "check its permissions, or name another folder with --out"
_ENVIRONMENT_MENDS = {
    errno.ENOSPC: "free some space, or name another folder with --out",
    errno.EDQUOT: "free some space, or name another folder with --out",
    errno.EFBIG: "raise the limit of a file's size, or name another folder with --out",
    errno.EACCES: _PERMISSION_MEND,
    errno.EPERM: _PERMISSION_MEND,
    errno.EROFS: _PERMISSION_MEND,
    errno.ENAMETOOLONG: "choose shorter names",
    errno.EMFILE: "raise the limit of open files",
    errno.ENFILE: "close other programs",
    errno.EIO: "check the disk",
}


def environment_error(error: OSError | MemoryError) -> InputError | None:
    """Return what the surroundings refuse, such as space or permission, as an error of exit code 2.

    ``None`` where ``error`` says no such thing: then it may be a fault of the program.
    """
    if isinstance(error, MemoryError):
        return InputError("memory", "there is not enough", mend="shorten or leave out recordings, or free some")
    if error.errno not in _ENVIRONMENT_MENDS:
        return None
    return InputError(str(error.filename or "files"), os.strerror(error.errno), mend=_ENVIRONMENT_MENDS[error.errno])
