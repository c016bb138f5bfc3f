"""Single values of the pipeline file that are no quantities: factors, marks, encodings, names."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, Field

SMALLEST = 1e-30  # of any number of a rig that is not 0, in SI: quotients stay finite


def size(number: float) -> float:
    """Return ``number``; raises ValueError where it is too small to divide by and not 0."""
    if 0.0 < abs(number) < SMALLEST:
        raise ValueError(f"{number} is next to nothing; wanted 0, or a size of at least {SMALLEST:g}")
    return number


def _is_scale(scale: float) -> float:
    if size(scale) == 0.0:
        raise ValueError(f"{scale} makes nothing of the column; wanted a factor other than 0")
    return scale


def _is_delimiter(text: str) -> str:
    known = text == "\t" or (len(text) == 1 and text.isascii() and text.isprintable() and not _in_numbers(text))
    if not (known or not text.strip(" ") or text in (r"\s+", "whitespace")):
        raise ValueError(f"{text!r} cannot stand between columns; wanted one character, such as a tab, ; or ,")
    return text


def _is_thousands(text: str) -> str:
    if text.isalnum() or text in "+-":
        raise ValueError(f"{text!r} cannot stand between thousands; wanted a character such as . or ,")
    return text


def _in_numbers(character: str) -> bool:
    return character.isalnum() or character in '+-."#'


def _is_encoding(name: str) -> str:
    """Check that the name is that of an encoding of text; the standard library has others, such as hex and zlib."""
    plain = "x" * 100 + ";1.5,-2e3\t\n"
    try:
        known = plain.encode(name).endswith(tuple(map(plain.encode, ("ascii", "utf-16le", "utf-16be", "utf-32le"))))
    except (LookupError, ValueError):
        known = False
    if not known:
        raise ValueError(f'"{name}" is no encoding of text; wanted one such as "utf-8", "cp1252" or "utf-16"')
    return name


Scale: TypeAlias = Annotated[float, AfterValidator(_is_scale)]
Mark: TypeAlias = Literal[".", ","]
Delimiter: TypeAlias = Annotated[str, Field(min_length=1), AfterValidator(_is_delimiter)]
Thousands: TypeAlias = Annotated[str, Field(min_length=1, max_length=1), AfterValidator(_is_thousands)]
Encoding: TypeAlias = Annotated[str, AfterValidator(_is_encoding)]
Column: TypeAlias = Annotated[int, Field(strict=True, ge=1)] | Annotated[str, Field(strict=True, min_length=1)]
Name: TypeAlias = Annotated[str, Field(pattern=r"\S")]
