"""What recorders write around and into numbers, and the plain text that is read in its place."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

_BLANK = "(?:\u00a0|\u2007|\u2009|\u202f)"  # blanks at which no line is broken
_SET = r"[^\s,=]+=[^\s,=]+"


@dataclass(frozen=True)
class Rewriting:
    """A pattern of a line and what is read for it, for text and for bytes in UTF-8; ``{}`` is the delimiter.

    ``seen``: the pattern that tells that a text is written so, where that is another one; ``said``: what of a text is
    left out.
    """

    pattern: str
    plain: str
    seen: str = ""
    said: str = ""

    def of(self, delimiter: str) -> tuple[re.Pattern[str], str]:
        """Return pattern and replacement in a text that is cut by a delimiter."""
        return re.compile(self.pattern.replace("{}", re.escape(delimiter)), re.MULTILINE), self.plain.replace(
            "{}", delimiter
        )


KEY = r"(?:^|(?<=[,;\t ]))[A-Za-z_]\w*(?:[ ]?[:=][ ]?(?=[-+]?\.?\d)|=(?=[^\s=]))"  # as in "p1:1.02", "state=on"
KEYED = Rewriting(KEY, "")
_REWRITINGS = (
    Rewriting(r"^([\d:.,]+)\s*->\s*", r"\1{}"),  # between a stamp and what a serial monitor shows after it
    Rewriting(rf"(?<=\d){_BLANK}(?=\d{{3}}(?!\d))", ""),  # between thousands
    Rewriting(_BLANK, " "),
    Rewriting("(?<![\\w.])−(?=[\\d.,])", "-"),  # the minus of typography
    Rewriting(r"(?<![\w.])([+-]?(?:\d+(?:\.\d*)?|\.\d+))[dD](?=[+-]\d{1,3}(?![\w.]))", r"\1E"),  # as Fortran writes
    Rewriting(r"(?<=[\d.])(?:\*|[ ]?[x×*][ ]?10)\^[({]?([+-]?\d+)[)}]?", r"E\1"),  # 1.5x10^-3, 1.5*^-3
    Rewriting(r"(?:^|(?<={}))\((\d(?:(?!{})[\d.,])*)\)(?=[ ]*(?:{}|\r?$))", r"-\1"),  # as in accounts
    Rewriting(r"(?:^|(?<={}))(\d(?:(?!{})[\d.,])*)-(?=[ ]*(?:{}|\r?$))", r"-\1"),  # the sign behind
    Rewriting(
        r"(?<=[\d.])[ ]?(?:±|\+/-|\+-)[ ]?(?:(?!{})[\d.,eE+-])+",
        "",
        said="what stands behind ± in a cell, its uncertainty, is left out",
    ),
    Rewriting(
        r" (?=[^\s,=]+=|\d{10,19}\s*$)", ",", seen=rf"^[^\s,=]+(?:,{_SET})* {_SET}(?:,{_SET})* \d{{10,19}}\s*$"
    ),  # line protocol: a name and tags, fields, and a stamp, apart by blanks
)


def rewritings_in(text: str) -> tuple[Rewriting, ...]:
    """Return the ways of writing that a text shows.

    >>> len(rewritings_in("1.0D+02 2.0D+00")), len(rewritings_in("D+02 2.0"))
    (1, 0)
    """
    return tuple(
        one for one in _REWRITINGS if re.search(one.seen or one.pattern.replace("{}", ","), text, re.MULTILINE)
    )


def in_bytes(rewritings: tuple[Rewriting, ...], delimiter: str) -> Iterator[tuple[re.Pattern[bytes], bytes]]:
    """Yield patterns and replacements for text in UTF-8."""
    for pattern, plain in (one.of(delimiter) for one in rewritings):
        yield re.compile(pattern.pattern.encode(), re.MULTILINE), plain.encode()
