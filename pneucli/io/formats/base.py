"""What every format of raw files says of itself."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pneucli.io.raw_file import Reader

ZIP_MAGIC = b"PK\x03\x04"  # of archives, workbooks and arrays of NumPy


@dataclass(frozen=True)
class Format:
    """A format of raw files.

    A file of this folder declares it, or a package of somebody else, as an entry point of the group
    ``pneucli.formats``; one file may hold several that share their code.

    Attributes:
        name: What messages call it.
        file: The files of it, for the documentation; "" for none of its own.
        open: Lists the columns of a file, and reads no more of it. What it raises becomes one sentence for the user,
            what it warns of a note. None of a format that is unpacked or refused.
        unpack: Writes what a packed file holds into an empty folder, and returns the path.
        refused: What is said of a format that is not read, and what to do about it.
        magic: The bytes that files of it begin with.
        pattern: A regular expression that the first 4096 bytes match where no magic does.
        recognises: Decides where these do not: by the first 4096 bytes, and by the path.
        column: What is a column of it, for the documentation.
        extra: The extra that reading it needs; "" for none.
        used: What is used of the metadata of its numbers.
        unused: What a user must know that is not used.
        place: Of formats that recognise a file, the one of the lowest place has it.
    """

    name: str
    file: str = ""
    open: Callable[[Path], Reader] | None = None
    unpack: Callable[[Path, Path], Path] | None = None
    refused: str = ""
    magic: tuple[bytes, ...] = ()
    pattern: bytes = b""
    recognises: Callable[[bytes, Path], bool] | None = None
    column: str = "a name"
    extra: str = ""
    used: str = ""
    unused: str = ""
    place: int = 0

    def has(self, head: bytes, path: Path) -> bool:
        """Return whether a file is of this format, by its first bytes."""
        told = head.startswith(self.magic) or (self.pattern and re.match(self.pattern, head) is not None)
        return bool(told) or (self.recognises is not None and self.recognises(head, path))
