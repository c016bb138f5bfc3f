"""Errors that a user can mend, with their exit codes, and the safe display of foreign text."""

from __future__ import annotations

import difflib
import errno
import os
import unicodedata
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field


@dataclass
class InputError(Exception):
    """An error in the input (exit code 2).

    Attributes:
        where: The file and, if possible, line, column or key (``"rig.toml, key rig.vessel.volume"``).
        found: What is there.
        wanted: What should be there.
        mend: What the user can do.
        faults: All faults, where one file has several.
        code: The kind of fault, an entry of ``fault_kinds.toml`` (``"E042"``); ``pneucli explain E042`` describes it.

    """

    where: str
    found: str
    wanted: str = ""
    mend: str = ""
    faults: Sequence[InputError] = ()
    code: str = field(default="", kw_only=True)

    exit_code = 2

    def __str__(self) -> str:
        parts = [f"{self.where}: {self.found}{self.code and f' [{self.code}]'}"]
        if self.wanted:
            parts.append(f"wanted: {self.wanted}")
        if self.mend:
            parts.append(f"mend: {self.mend}")
        return "\n".join(["\n  ".join(map(printable, parts)), *map(str, self.faults)])


class UnitError(ValueError):
    """A unit or quantity that cannot be read; config and ingest turn it into an InputError."""


MAX_LISTED = 40  # names in a message


def did_you_mean(word: str, choices: Iterable[str], listed: str = "known") -> str:
    """Return ``'did you mean "x"?'`` for the closest of ``choices``, or the list (of the first) where none is close.

    ``listed`` says what the list has.
    """
    choices = sorted(choices)
    close = difflib.get_close_matches(word, choices) or difflib.get_close_matches(word.lower(), choices)
    close.sort(key=lambda one: sorted(one) != sorted(word))  # transposed letters first
    more = ", ..." * (len(choices) > MAX_LISTED)
    return f'did you mean "{close[0]}"?' if close else f"{listed}: {', '.join(choices[:MAX_LISTED])}{more}"


def require_known(
    names: Iterable[str], known: Collection[str], where: str, found: str = '"{}"', wanted: str = "", *, code: str
) -> None:
    """Raise InputError for the first name that is not among the known ones; ``found`` says it, with the name at ``{}``.

    >>> require_known(["stribek"], ["stribeck"], "--exclude", 'no effect "{}"', code="E030")
    Traceback (most recent call last):
    pneucli.errors.InputError: --exclude: no effect "stribek" [E030]
      mend: did you mean "stribeck"?
    """
    for name in names:
        if name not in known:
            raise InputError(where, found.replace("{}", name), wanted, did_you_mean(name, known), code=code)


# control, no character, half of a pair (a byte that is no UTF-8), line ends
_INVISIBLE_CATEGORIES = {"Cc", "Cn", "Cs", "Zl", "Zp"}
# what follows is shown in another order
_DIRECTION_CHANGES = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}


def printable(text: str, keep: str = "") -> str:
    """Return ``text`` with control characters and other invisible ones escaped, except those in ``keep``."""
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
    """Return an error of the environment, such as a full disk or a missing permission, as an error of exit code 2.

    ``None`` for any other error, which may be a fault of the program.
    """
    if isinstance(error, MemoryError):
        return InputError(
            "memory", "too little memory", mend="shorten or leave out recordings, or free some", code="E005"
        )
    if error.errno not in _ENVIRONMENT_MENDS:
        return None
    return InputError(
        str(error.filename or "files"), os.strerror(error.errno), mend=_ENVIRONMENT_MENDS[error.errno], code="E005"
    )
