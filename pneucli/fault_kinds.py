"""The kinds of faults that a user can mend, by their stable codes (``fault_kinds.toml``)."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any


@dataclass(frozen=True)
class Example:
    """How a fault arises: base files, one replacement in them, further files, and what is run.

    Attributes:
        command: The command that fails; empty where ``python`` fails.
        python: The Python code that fails.
        output: What the program prints, in a folder of its own.
        change: A text of the base files, and what stands in its place.
        files: Further files by their path; they replace those of the base.
        zip: Archives by their path, with the files that they contain.
        encoding: The encoding of the pipeline file.
        without: Packages that are not installed.

    """

    command: str = ""
    python: str = ""
    output: str = ""
    change: Sequence[str] = ()
    files: Mapping[str, str] = field(default_factory=dict)
    zip: Mapping[str, Sequence[str]] = field(default_factory=dict)
    encoding: str = "utf-8"
    without: Sequence[str] = ()


@dataclass(frozen=True)
class FaultKind:
    """One kind of fault: what is found, and the mend."""

    code: str
    title: str
    found: str
    mend: str
    example: Example


@cache
def _document() -> dict[str, Any]:
    return tomllib.loads(files("pneucli").joinpath("fault_kinds.toml").read_text(encoding="utf-8"))


def base_files() -> dict[str, str]:
    """Return the files from which every example starts."""
    return {name: text.lstrip("\n") for name, text in _document()["base"].items()}


def fault_kinds() -> dict[str, FaultKind]:
    """Return every kind by its code."""
    return {code: _kind(code, dict(entry)) for code, entry in _document().items() if code != "base"}


def _kind(code: str, entry: dict[str, Any]) -> FaultKind:
    title, found, mend = (entry.pop(key) for key in ("title", "found", "mend"))
    return FaultKind(code, title, found, mend, Example(**entry))
