"""Every place where the code can be mutated, and its mutants; the faults are those of mutmut's operators."""

import difflib
import random
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import libcst as cst
from libcst.metadata import MetadataWrapper, PositionProvider
from mutmut.mutation.mutators import mutation_operators

NEVER_RUN = (cst.Annotation, cst.Decorator, cst.Import, cst.ImportFrom)
CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*")


@dataclass(frozen=True)
class Mutant:
    """One fault: ``text`` is that of the whole file with the fault in it; ``lines`` those of its statement."""

    file: str
    lines: tuple[int, ...]
    was: str
    text: str

    @property
    def diff(self) -> tuple[str, str]:
        """The lines that differ, before and after, without what surrounds them."""
        rows = list(difflib.unified_diff(self.was.splitlines(), self.text.splitlines(), n=0, lineterm=""))[2:]
        before, after = ("\n".join(row[1:].strip() for row in rows if row[0] == sign) for sign in "-+")
        return before, after


@dataclass(frozen=True)
class Place:
    """A node of a file's tree with the nodes that mutmut would put there."""

    file: str
    lines: tuple[int, ...]
    module: cst.Module
    node: cst.CSTNode
    instead: tuple[cst.CSTNode, ...]

    def mutant(self, rng: random.Random) -> Mutant | None:
        """Return one of the mutants, or None where none is Python that differs."""
        was = self.module.code
        for node in rng.sample(self.instead, len(self.instead)):
            text = self.module.deep_replace(self.node, node).code  # type: ignore[arg-type]
            if text != was and _compiles(text):
                return Mutant(self.file, self.lines, was, text)
        return None


class _Finder(cst.CSTVisitor):
    METADATA_DEPENDENCIES = (PositionProvider,)

    def __init__(self, file: str, module: cst.Module) -> None:
        super().__init__()
        self.file, self.module = file, module
        self.found: list[Place] = []
        self._statements: list[cst.CSTNode] = []
        self._line = 1

    def on_visit(self, node: cst.CSTNode) -> bool:
        if isinstance(node, NEVER_RUN) or self._names_a_type(node):
            return False
        position = self.get_metadata(PositionProvider, node, None)
        self._line = position.start.line if position else self._line
        if isinstance(node, cst.BaseSmallStatement | cst.BaseCompoundStatement):
            self._statements.append(node)
        instead = tuple(
            new for kind, operator in mutation_operators if isinstance(node, kind) for new in operator(node)
        )
        if instead:
            first = self.get_metadata(PositionProvider, self._statements[-1]).start.line
            self.found.append(Place(self.file, (self._line, first), self.module, node, instead))
        return True

    def on_leave(self, original_node: cst.CSTNode) -> None:
        if self._statements and original_node is self._statements[-1]:
            self._statements.pop()

    def _names_a_type(self, node: cst.CSTNode) -> bool:
        """Whether a statement of the module names a type, or what it exports: only constants are values."""
        if self._statements or not isinstance(node, cst.Assign):
            return False
        names = re.findall(r"\w+", self.module.code_for_node(node.targets[0].target))
        return not all(map(CONSTANT.fullmatch, names))


def places(root: Path, package: str) -> Iterator[Place]:
    """Yield all places of a package below ``root``."""
    for path in sorted((root / package).rglob("*.py")):
        wrapper = MetadataWrapper(cst.parse_module(path.read_text()))
        finder = _Finder(path.relative_to(root).as_posix(), wrapper.module)
        wrapper.visit(finder)
        yield from finder.found


def sample(root: Path, packages: Mapping[str, int], seed: int) -> list[Mutant]:
    """Return as many mutants of each package as asked for: a place is drawn, then one of its mutants.

    So a text or a call, of which many mutants can be made, weighs no more than a sign or a bound.
    """
    rng = random.Random(seed)
    drawn = []
    for package, number in packages.items():
        found = list(places(root, package))
        made = filter(None, (place.mutant(rng) for place in rng.sample(found, len(found))))
        drawn += [mutant for _, mutant in zip(range(number), made, strict=False)]
    rng.shuffle(drawn)  # so that what has run after half of the time stands for all
    return drawn


def shares(root: Path, packages: tuple[str, ...], number: int) -> dict[str, int]:
    """Return how many of ``number`` fall to each package, in proportion to its lines."""
    lines = {p: sum(len(f.read_text().splitlines()) for f in (root / p).rglob("*.py")) for p in packages}
    edges, seen = [0], 0
    for count in lines.values():
        seen += count
        edges.append(round(number * seen / sum(lines.values())))
    return {p: last - first for p, first, last in zip(packages, edges, edges[1:], strict=False)}


def _compiles(text: str) -> bool:
    try:
        compile(text, "mutant", "exec")
    except SyntaxError:
        return False
    return True
