"""The rows of a text file as plain UTF-8 for the CSV parser."""

from __future__ import annotations

import codecs
import io
import re
from pathlib import Path

from pneucli.errors import InputError
from pneucli.io.rewritings import in_bytes
from pneucli.io.text_layout import HEAD_BYTES, MIN_ROWS_ABOVE, TextLayout, lines_above, table_end

MAX_LINE_BYTES = 16 << 20  # bytes of a line
_WORDS_BELOW = re.compile(rb"\n[ \t\r]*\n\s*\"?[A-Za-z\[(*=\x80-\xff]")
_COMMENT = re.compile(rb"^[ \t]*#[^\n]*\n?", re.MULTILINE)
_BLANKS = re.compile(rb"[ \t]+")
_EDGES = re.compile(rb"^[ \t]+|[ \t]+(?=\r?$)", re.MULTILINE)


class NormalizedTextStream(io.RawIOBase):
    """The rows of a text file as plain UTF-8 without comment lines; blanks as delimiters become one tab.

    Reads the file once, from the front, in whole lines, so that a file of any size passes through bounded memory.
    ``header_lines`` counts the headers that stand again among the rows and were passed over, ``comment_lines``
    counts the comment lines among the rows; ``ends_with_newline`` says whether the last row had an end of line.
    ``second_table`` has line (from 1) and text of the first line below the table that belongs to it no more.
    """

    def __init__(self, path: Path, look: TextLayout) -> None:
        self._path = path
        self._file = path.open("rb", buffering=0)
        self._encoding = look.encoding
        self._decoder = (
            None if _is_ascii_compatible(look.encoding) else codecs.getincrementaldecoder(look.encoding)("replace")
        )
        self._blanks = look.delimiter == " "
        self._delimiter = look.delimiter.encode()
        self._padding = re.compile(rb" *%b *" % re.escape(self._delimiter))
        self._line_end = look.line_end.encode()
        self._rewritings = [*in_bytes(look.rewritings, "\t" if self._blanks else look.delimiter)]
        self._skip = look.skip
        self._left = look.lines
        self._repeated = [line.encode() for line in look.repeated]
        self._rest = b""
        self._split, self._line, self._begun = look.split, 0, False
        self.second_table: tuple[int, str] | None = None
        self._over = False
        self.comment_lines = 0
        self.header_lines = 0
        self.ends_with_newline = True

    def readable(self) -> bool:
        """Return True."""
        return True

    def read(self, size: int = -1) -> bytes:
        """Return about ``size`` bytes of whole rows; nothing at the end."""
        while not self._over:
            if block := self._plain(self._lines(max(size, HEAD_BYTES))):
                return block
        return b""

    @property
    def last_line(self) -> int:
        """The number, from 1, of the last line that was read."""
        return self._line + (not self.ends_with_newline)

    def _lines(self, size: int) -> bytes:
        block = self._file.read(size)
        self._over = not block
        if self._decoder is None:
            block = block.rstrip(b"\0")
        else:
            block = self._decoder.decode(block, final=self._over).encode()
        if self._line_end != b"\n":
            block = block.replace(self._line_end, b"\n")
        if self._over:
            block, self._rest = self._rest + block, b""
            self.ends_with_newline = not block.strip()
            return block
        end = block.rfind(b"\n") + 1
        lines, self._rest = (self._rest + block[:end], block[end:]) if end else (b"", self._rest + block)
        if len(self._rest) > MAX_LINE_BYTES:
            found, mend = f"a line of more than {MAX_LINE_BYTES >> 20} MB", "check the file, record or copy it again"
            raise InputError(str(self._path), found, "rows of numbers", mend, code="E041")
        return lines

    def _plain(self, block: bytes) -> bytes:
        while self._skip and block:
            block = block.partition(b"\n")[2]
            self._skip -= 1
            self._line += 1
        if _WORDS_BELOW.search(block):
            block = self._first_table(block)
        self._line, self._begun = self._line + block.count(b"\n"), True
        if self._left is not None:
            block = self._within_part(block)
        if not self._decoder and not block.isascii():
            block = block.decode(self._encoding, "replace").encode()
        if self._repeated and self._repeated[0] and self._repeated[0] in block:
            block = self._without_headers(block)
        if b"#" in block:
            block, comments = _COMMENT.subn(b"", block)
            self.comment_lines += comments
        for pattern, plain in self._rewritings:
            block = pattern.sub(plain, block)
        if self._blanks:
            return _BLANKS.sub(b"\t", _EDGES.sub(b"", block))
        padded = b" " + self._delimiter in block or self._delimiter + b" " in block
        return self._padding.sub(self._delimiter, _EDGES.sub(b"", block)) if padded else block

    def _first_table(self, block: bytes) -> bytes:
        """Return the lines of a block up to where another table, or words, begin below a blank line."""
        encoding = "utf-8" if self._decoder else self._encoding
        lines = block.decode(encoding, "replace").split("\n")
        above = [line.decode() for line in self._repeated]
        begins = table_end([*above, *lines], self._split, 1 if self._begun else MIN_ROWS_ABOVE)
        if begins is None:
            return block
        begins -= len(above)
        at = next(n for n in range(begins, len(lines)) if lines[n].strip())
        self.second_table, self._over = (self._line + at + 1, lines[at].strip()), True
        return b"\n".join(block.split(b"\n")[:begins]) + b"\n"

    def _within_part(self, block: bytes) -> bytes:
        """Return the lines of a block that belong to the part that is read."""
        lines = block.splitlines(keepends=True)[: self._left]
        self._left = (self._left or 0) - len(lines)
        return b"".join(lines)

    def _without_headers(self, block: bytes) -> bytes:
        """Return a block without the lines of the header that stand again in it, and without those right above them."""
        kept: list[bytes] = []
        for line in block.splitlines(keepends=True):
            if line.strip() not in self._repeated:
                kept.append(line)
            elif line.strip() == self._repeated[0]:
                self.header_lines += 1
                del kept[len(kept) - lines_above(kept, self._repeated[0], self._delimiter) :]
        return b"".join(kept)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        super().close()


def _is_ascii_compatible(encoding: str) -> bool:
    """Return whether the first 128 characters are bytes as in ASCII: then lines may be cut before they are decoded."""
    plain = bytes(range(128))
    try:
        return plain.decode(encoding).encode() == plain
    except UnicodeDecodeError:
        return False
