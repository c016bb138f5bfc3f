"""Count what the structure of the program is: ``python -m tests.structure [CHECKOUT]`` prints one table.

Imports under ``TYPE_CHECKING`` count like all others. A unit is a package or a module directly below ``pneucli``.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCUMENTED = ("physics", "tp", "identify", "simulate", "design", "controller", "noise")
PRIVATE_WORDS = tuple(
    re.findall(
        r"\w+",
        """beside told tells standing likely lawful outdone unlike foremost astray promise judged weighed rung law
        stretches carried settled feels felt acts_in alone lacking hats said bread meat naming elsewhere known loosen
        stir haste firm calm hurried spared missed least fewest near kept sure slight enough words""",
    )
)


@dataclass(frozen=True)
class Module:
    """One file of the program: its dotted name, its text and its syntax tree."""

    name: str
    text: str
    tree: ast.Module

    @property
    def lines(self) -> int:
        return len(self.text.splitlines())


def modules(root: Path = ROOT) -> dict[str, Module]:
    """Every module of the program by its dotted name."""
    found = {}
    for path in sorted((root / "pneucli").rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        text = path.read_text(encoding="utf-8")
        found[name] = Module(name, text, ast.parse(text))
    return found


def imports(module: Module, names: set[str]) -> Iterator[str]:
    """The modules of the program that a module imports anywhere, also inside functions."""
    for node in ast.walk(module.tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                if full in names or node.module in names:
                    yield full if full in names else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in names)


def import_graph(found: dict[str, Module]) -> dict[str, set[str]]:
    """Which modules each module imports."""
    names = set(found)
    return {name: set(imports(module, names)) - {name} for name, module in found.items()}


def unit(name: str) -> str:
    """The package or module directly below ``pneucli`` in which a module stands."""
    return ".".join(name.split(".")[:2])


def unit_graph(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """Which units each unit imports."""
    units: dict[str, set[str]] = {}
    for name, targets in graph.items():
        units.setdefault(unit(name), set()).update(unit(target) for target in targets)
    return {name: targets - {name} for name, targets in units.items()}


def cycles(graph: dict[str, set[str]]) -> list[list[str]]:
    """The groups of nodes that reach each other (Tarjan's strongly connected components of two nodes or more)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    groups: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for target in sorted(graph.get(node, ())):
            if target not in index:
                visit(target)
                low[node] = min(low[node], low[target])
            elif target in stack:
                low[node] = min(low[node], index[target])
        if low[node] == index[node]:
            group = [stack.pop()]
            while group[-1] != node:
                group.append(stack.pop())
            if len(group) > 1:
                groups.append(sorted(group))

    for node in graph:
        if node not in index:
            visit(node)
    return groups


def depth(graph: dict[str, set[str]]) -> int:
    """The number of nodes on the longest chain of imports, each cycle counted as one node."""
    member = {name: group[0] for group in cycles(graph) for name in group}
    merged: dict[str, set[str]] = {}
    for name, targets in graph.items():
        node = member.get(name, name)
        merged.setdefault(node, set()).update(member.get(target, target) for target in targets)
    longest: dict[str, int] = {}

    def length(node: str) -> int:
        if node not in longest:
            longest[node] = 1 + max((length(target) for target in merged.get(node, set()) - {node}), default=0)
        return longest[node]

    return max(length(node) for node in merged)


def private_words(found: dict[str, Module]) -> dict[str, int]:
    """How often each of the private words stands in the program, as a word or as a part of a name."""
    text = "\n".join(module.text for module in found.values()).lower()
    words = re.findall(r"[a-z]+", text)
    return {word: sum(w == word for w in words) for word in PRIVATE_WORDS}


def public_functions(found: dict[str, Module]) -> Iterator[tuple[str, ast.FunctionDef]]:
    """The public functions of the packages whose docstrings are specifications."""
    for name, module in found.items():
        if name.split(".")[1:2] and name.split(".")[1] in DOCUMENTED:
            for node in module.tree.body:
                if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                    yield name, node


def docstrings(found: dict[str, Module]) -> dict[str, float]:
    """The share of these functions whose docstring has each part of a specification, in per cent."""
    texts = [ast.get_docstring(node) or "" for _, node in public_functions(found)]
    parts = {
        "Args or Returns": r"^(Args|Returns):",
        "units": r"\b(m|mm|s|ms|kg|N|Pa|bar|V|K|Hz|J|W|rad)\b(\^|/|\)|,|\.|;| )",
        "references": r"^References?:",
        "doctest": r">>> ",
    }
    return {
        part: 100 * sum(bool(re.search(pattern, text, re.MULTILINE)) for text in texts) / max(len(texts), 1)
        for part, pattern in parts.items()
    }


def words_per_page(root: Path = ROOT) -> dict[str, int]:
    """The number of words of each page."""
    pages = [root / "README.md", *sorted((root / "docs").rglob("*.md"))]
    return {page.relative_to(root).as_posix(): len(page.read_text(encoding="utf-8").split()) for page in pages}


def summary(root: Path = ROOT) -> dict[str, float]:
    """Every figure of the structure by its title."""
    found = modules(root)
    graph = import_graph(found)
    lengths = [module.lines for name, module in found.items()]
    return {
        "packages and modules below pneucli": len(unit_graph(graph)) - 1,
        "depth of their import graph": depth(unit_graph(graph)),
        "cycles of these": len(cycles(unit_graph(graph))),
        "cycles of modules": len(cycles(graph)),
        "files": len(found),
        "lines": sum(lengths),
        "files under 40 lines": sum(length < 40 for length in lengths),
        "files over 250 lines": sum(length > 250 for length in lengths),
        "private words": sum(private_words(found).values()),
        "public functions of " + ", ".join(DOCUMENTED): len(list(public_functions(found))),
        **{f"docstrings with {part}, %": round(share) for part, share in docstrings(found).items()},
        "pages": len(words_per_page(root)),
        "words in pages": sum(words_per_page(root).values()),
    }


def main() -> None:
    """Print the table, then cycles, then words a page."""
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT
    for title, value in summary(root).items():
        print(f"{value:8g}  {title}")
    graph = import_graph(modules(root))
    for group in cycles(graph):
        print("cycle:", " ".join(group))
    counts = private_words(modules(root))
    print("private words:", ", ".join(f"{word} {n}" for word, n in sorted(counts.items(), key=lambda x: -x[1]) if n))
    for page, count in sorted(words_per_page(root).items(), key=lambda item: -item[1])[:12]:
        print(f"{count:8d}  {page}")


if __name__ == "__main__":
    main()
