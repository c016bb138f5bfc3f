"""Make the page of constants: every commented number of identification and diagnosis, from the source."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("diagnose", "identify")
HEAD = """# Constants of identification and diagnosis

Made by `make docs` from the source: each constant, its value, and its comment. This reference table is longer
than other pages. [Inside the diagnosis](diagnosis.md) explains where they act, [The method](../method.md) what for.

| constant | value | comment |
| --- | --- | --- |
"""


def page() -> str:
    """Return the page."""
    package = Path(__file__).parents[1]
    files = sorted(file for name in PACKAGES for file in (package / name).rglob("*.py"))
    rows = [
        f"| `{'.'.join(file.relative_to(package).with_suffix('').parts)}.{name}` | {value} | {comment} |"
        for file in files
        for name, value, comment in _constants(file.read_text(encoding="utf-8"))
    ]
    return HEAD + "\n".join(rows) + "\n"


def _constants(source: str) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and comment of each constant number at the top of a module."""
    lines = source.splitlines()
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign) and (comment := _comment(lines, node)):
            for name, value in _pairs(node):
                if name.isupper():
                    yield name, value, comment.replace("|", "\\|")


def _pairs(node: ast.Assign) -> Iterator[tuple[str, str]]:
    target, value = node.targets[0], node.value
    pairs = [(target, value)]
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        pairs = list(zip(target.elts, value.elts, strict=True))
    for name, number in pairs:
        if isinstance(name, ast.Name) and isinstance(number, ast.Constant) and isinstance(number.value, int | float):
            yield name.id, ast.unparse(number)


def _comment(lines: list[str], node: ast.Assign) -> str:
    """Return the comment behind an assignment, or else the one above it."""
    line = lines[node.lineno - 1][node.end_col_offset :] if node.end_lineno == node.lineno else ""
    if trailing := re.match(r"\s*#\s*(.+)", line):
        return trailing[1]
    above: list[str] = []
    for text in reversed(lines[: node.lineno - 1]):
        if not text.startswith("#"):
            break
        above.insert(0, text.lstrip("# "))
    return " ".join(above)
