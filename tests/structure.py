"""Count what the structure of the program is: ``python -m tests.structure [CHECKOUT] [--walks]`` prints one table.

Imports under ``TYPE_CHECKING`` count like all others. A unit is a package or a module directly below ``pneucli``. A
line of code holds something other than a docstring, a comment or nothing. A walk counts the modules that one command
passes through, and the pairs of modules of which one calls the other.
"""

import argparse
import ast
import math
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCUMENTED = ("physics", "tp", "identify", "simulate", "design", "controller", "noise")
TRANSLATED = ("pneucli.controller.", "pneucli.simulate.kernel.")  # into C and structured text, or compiled as a whole
PORTS = "pneucli.simulate.kernel.ports"
LAID_OUT = {"self", "s", "c", "par"}  # state and constants of a controller: each index of theirs has a unit in layout
ARRAY = re.compile(r"(?<!types\.)\b(Array|NDArray|ArrayLike)\b")
NUMBER = re.compile(r"\bfloat\b|(?<!types\.)\b(Array|ArrayLike|NDArray\[np\.float64\])")
PLAIN = re.compile(
    r"(float|int|str|tuple\[(float|int)(, (float|int|\.\.\.))*\]|Sequence\[(float|int|str)\])( \| None)?"
)
UNIT = re.compile(
    r"(?<![\w`])(m|mm|um|cm|s|ms|us|kg|g|N|Pa|kPa|bar|V|mV|K|Hz|kHz|J|W|rad|samples?|%|per cent|1/\w+|SI|units?"
    r"|dimensionless|shares?|ratio|relative|normali[sz]ed|factors?|probabilit\w+|weights?)(?![\w`])"
)
SHAPE = re.compile(r"\([\w.]+,\)|\(\w+(, [\w .+*-]+)+\)|\bshapes?\b|\bbroadcast")
SOURCE = re.compile(
    r"^References?:|[Tt]hesis|ISO \d|IEC|JCGM|source=|\(\d\.\d+\)|\b(19|20)\d\d\b|docs/\w", re.MULTILINE
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

    @property
    def code_lines(self) -> int:
        """Lines that hold code."""
        documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
        nodes = (n for n in ast.walk(self.tree) if isinstance(n, documented) and ast.get_docstring(n))
        docs = {line for n in nodes for line in range(n.body[0].lineno, (n.body[0].end_lineno or 0) + 1)}
        lines = enumerate(self.text.splitlines(), 1)
        return sum(i not in docs and bool(line.strip()) and not line.lstrip().startswith("#") for i, line in lines)

    def nodes(self, *kinds: type[ast.AST]) -> Iterator[ast.AST]:
        """All nodes of some kinds."""
        return (node for node in ast.walk(self.tree) if isinstance(node, kinds))


def modules(root: Path = ROOT, folder: str = "pneucli") -> dict[str, Module]:
    """Every module of the program, or of another folder, by its dotted name."""
    found = {}
    for path in sorted((root / folder).rglob("*.py")):
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


def public_functions(found: dict[str, Module]) -> Iterator[tuple[Module, ast.FunctionDef]]:
    """The public functions of the packages whose docstrings are specifications.

    Code that is translated has no names that begin with an underscore: of it, those are public that another module
    names. The ports of the kernel are specified where they are declared, in ``pneucli.physics.ports``.
    """
    named = {name: set(re.findall(r"\w+", module.text)) for name, module in found.items()}
    for name, module in found.items():
        if unit(name).removeprefix("pneucli.") not in DOCUMENTED or name == PORTS:
            continue
        for node in module.tree.body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                elsewhere = any(node.name in words for other, words in named.items() if other != name)
                if elsewhere or not name.startswith(TRANSLATED):
                    yield module, node


def signature(function: ast.FunctionDef) -> tuple[dict[str, str], str]:
    """The arguments that a docstring has to explain with their types, and the type of the result.

    Translated code has no annotations; what it takes and returns are numbers.
    """
    arguments = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
    types = {one.arg: ast.unparse(one.annotation) if one.annotation else "float" for one in arguments}
    if function.returns is not None:
        result = ast.unparse(function.returns)
    elif (ast.get_docstring(function) or "").startswith("Whether"):
        result = "bool"
    else:
        result = "float" if any(isinstance(n, ast.Return) and n.value for n in ast.walk(function)) else "None"
    return {name: kind for name, kind in types.items() if name not in LAID_OUT}, result


def specification(module: Module, function: ast.FunctionDef) -> dict[str, bool]:
    """Which parts of a specification apply to a public function, and whether its docstring has them.

    - arguments: each number is named, unless it is the only argument
    - units: where numbers go in or out; "share", "factor" and the like say that there is none
    - shapes: where arrays go in or out
    - errors: where it raises one itself
    - source: where it returns a number that it has multiplied or divided; the module's docstring may have it
    - doctest: where it turns plain numbers and words into numbers
    """
    text, (arguments, result) = ast.get_docstring(function) or "", signature(function)
    types, numbers = [*arguments.values(), result], [name for name, kind in arguments.items() if NUMBER.search(kind)]
    products = (n for n in ast.walk(function) if isinstance(n, ast.BinOp))
    is_equation = any(isinstance(n.op, (ast.Mult, ast.Div, ast.Pow, ast.MatMult)) for n in products)
    source = text + (ast.get_docstring(module.tree) or "") + " ".join(re.findall(r"^    source=.*", module.text, re.M))
    is_annotated = all(one.annotation for one in function.args.args)
    parts = {
        "arguments": (bool(arguments), len(arguments) == 1 or all(re.search(rf"\b{n}\b", text) for n in numbers)),
        "units": (any(map(NUMBER.search, types)), bool(UNIT.search(text))),
        "shapes": (any(map(ARRAY.search, types)), bool(SHAPE.search(text))),
        "errors": (any(isinstance(n, ast.Raise) for n in ast.walk(function)), "Raises:" in text),
        "source": (is_equation and bool(NUMBER.search(result)), bool(SOURCE.search(source))),
        "doctest": (is_annotated and bool(arguments) and all(map(PLAIN.fullmatch, types)), ">>> " in text),
    }
    return {part: has for part, (applies, has) in parts.items() if applies}


def docstrings(found: dict[str, Module]) -> dict[str, float]:
    """The share of public functions whose docstring has each part of a specification that applies, in per cent."""
    had = [specification(*one) for one in public_functions(found)]
    share = lambda those: 100 * sum(those) / max(len(those), 1)  # noqa: E731
    parts = ("arguments", "units", "shapes", "errors", "source", "doctest")
    return {part: share([one[part] for one in had if part in one]) for part in parts} | {
        "all that applies": share([all(one.values()) for one in had])
    }


def fields(node: ast.ClassDef) -> set[str]:
    """The annotated attributes of a class."""
    return {n.target.id for n in node.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}


def interval_types(found: dict[str, Module]) -> list[str]:
    """The classes that hold one number with its interval."""
    ends = ({"ci95"}, {"interval"}, {"low", "high"}, {"ci_low", "ci_high"})
    return [
        f"{name}.{node.name}"
        for name, module in found.items()
        for node in module.nodes(ast.ClassDef)
        if isinstance(node, ast.ClassDef)
        and fields(node) & {"value", "before", "start"}
        and any(pair <= fields(node) for pair in ends)
    ]


def telling(found: dict[str, Module]) -> list[str]:
    """The classes that tell a person what was found, and the functions that write findings and warnings."""
    words = {"found", "message", "reason", "cause", "failure"}
    return [
        f"{name}.{node.name}"
        for name, module in found.items()
        for node in module.nodes(ast.ClassDef, ast.FunctionDef)
        if (isinstance(node, ast.ClassDef) and fields(node) & words)
        or (isinstance(node, ast.FunctionDef) and re.search(r"(finding|warning)s?(_text)?$", node.name))
    ]


def dict_annotations(found: dict[str, Module]) -> int:
    """Arguments, results and attributes that are annotated as a mapping of names to anything."""
    untyped = re.compile(r"\b(dict|Mapping)\[str, Any\]")
    annotated = (
        getattr(node, slot, None)
        for module in found.values()
        for node in module.nodes(ast.arg, ast.AnnAssign, ast.FunctionDef)
        for slot in ("annotation", "returns")
    )
    return sum(bool(untyped.search(ast.unparse(one))) for one in annotated if one is not None)


def string_subscripts(found: dict[str, Module]) -> int:
    """How often a key stands between square brackets."""
    nodes = (n for module in found.values() for n in module.nodes(ast.Subscript) if isinstance(n, ast.Subscript))
    return sum(isinstance(node.slice, ast.Constant) and isinstance(node.slice.value, str) for node in nodes)


def body_lengths(found: Iterable[Module]) -> list[int]:
    """The number of lines of each function's body, its docstring not counted."""
    functions = [n for module in found for n in module.nodes(ast.FunctionDef) if isinstance(n, ast.FunctionDef)]
    bodies = [n.body[1:] if ast.get_docstring(n) else n.body for n in functions]
    return [(body[-1].end_lineno or 0) - body[0].lineno + 1 for body in bodies if body]


WALKER = """
import sys, typing
files, pairs = set(), set()
def look(frame, event, _):
    there, here = frame.f_code.co_filename, frame.f_back and frame.f_back.f_code.co_filename
    if event == "call" and PACKAGE in there and not frame.f_code.co_name.startswith("<"):
        files.add(there)
        if here and PACKAGE in here and here != there:
            pairs.add((here, there))
PACKAGE, sys.argv = sys.argv[1], ["pneucli", *sys.argv[2:]]
from pneucli.cli import main
import atexit
atexit.register(lambda: (sys.setprofile(None), print("walk", len(files), len(pairs), file=sys.stderr)))
sys.setprofile(look)
main()
"""


def walks(root: Path = ROOT) -> dict[str, float]:
    """Modules that a command passes through, and pairs of them that call each other, each stage on its own."""
    found = {}
    with tempfile.TemporaryDirectory() as scratch:
        shutil.copytree(root / "fixtures" / "valve_null", scratch, dirs_exist_ok=True)
        for stage in ("ingest", "identify", "compare", "diagnose"):
            words = [sys.executable, "-c", WALKER, str(root / "pneucli"), stage, f"{scratch}/pipeline.toml"]
            run = subprocess.run(words, cwd=root, capture_output=True, text=True, encoding="utf-8", check=True)
            files, pairs = re.findall(r"^walk (\d+) (\d+)", run.stderr, re.MULTILINE)[0]
            found |= {f"walk of {stage}: modules": int(files), f"walk of {stage}: pairs that call": int(pairs)}
    return found


QUESTIONS = {  # what a reader looks for: the files that answer
    "flow function": ("physics.gas",),
    "Stribeck friction": ("physics.effects.stribeck",),
    "likelihood": ("identify.estimation.objective", "diagnose.score"),
    "effect declared": ("physics.declaration",),
    "95 interval": ("identify.estimation.intervals",),
    "effect refused reason": ("diagnose.decision", "diagnose.constraints", "diagnose.candidate"),
    "controller holds standstill": ("controller.standstill",),
    "TDMS clock": ("io.formats.tdms",),
    "probability effect": ("diagnose.calibration",),
    "HTML page": ("report.page",),
    "exit codes": ("cli", "cli.program", "errors"),
    "add command": ("cli.command", "cli.program"),
}
PATIENCE = 5  # wrong files, after which a reader asks somebody


def names_to_go_by(found: dict[str, Module]) -> dict[str, list[str]]:
    """What a reader sees of each file: its name, the first line of its docstring, what it defines, its folders."""
    seen = {}
    for name, module in found.items():
        defined = (n.name for n in ast.walk(module.tree) if isinstance(n, (ast.FunctionDef, ast.ClassDef)))
        first = (ast.get_docstring(module.tree) or "").partition("\n")[0]
        seen[name] = [one.lower() for one in (name.rpartition(".")[2], first, " ".join(defined), name)]
    return seen


def wrong_turns(seen: dict[str, list[str]], question: str, answers: tuple[str, ...]) -> int:
    """How many files a reader opens in vain who goes by :func:`names_to_go_by` alone.

    He opens files in the order of how many words of the question, the rarer the more, are in the name of the file
    (3), the first line of its docstring (2), names of its functions and classes (1), and its folders (1/2).
    """
    words = [word.lower().rstrip("s") for word in question.split()]
    rarity = {word: math.log(len(seen) / max(1, sum(word in " ".join(one) for one in seen.values()))) for word in words}

    def promise(name: str) -> float:
        return sum(
            rarity[w] * share for w in words for share, one in zip((3, 2, 1, 0.5), seen[name], strict=True) if w in one
        )

    order = sorted(seen, key=lambda name: (-promise(name), len(name)))
    places = [order.index(f"pneucli.{answer}") for answer in answers if f"pneucli.{answer}" in seen]
    return min([*places, PATIENCE])


def words_per_page(root: Path = ROOT) -> dict[str, int]:
    """The number of words of each page."""
    pages = [root / "README.md", *sorted((root / "docs").rglob("*.md"))]
    return {page.relative_to(root).as_posix(): len(page.read_text(encoding="utf-8").split()) for page in pages}


def summary(root: Path = ROOT) -> dict[str, float]:
    """Every figure of the structure by its title."""
    found = modules(root)
    graph, names = import_graph(found), names_to_go_by(found)
    lengths = [module.lines for name, module in found.items()]
    bodies = body_lengths(found.values())
    others = {folder: modules(root, folder) for folder in ("tests", "benchmarks")}
    return {
        "packages and modules below pneucli": len(unit_graph(graph)) - 1,
        "depth of their import graph": depth(unit_graph(graph)),
        "cycles of these": len(cycles(unit_graph(graph))),
        "cycles of modules": len(cycles(graph)),
        "modules": len(found),
        "lines": sum(lengths),
        "lines of code": sum(module.code_lines for module in found.values()),
        **{f"modules of {name}": len(of) for name, of in others.items()},
        **{f"lines of code of {name}": sum(one.code_lines for one in of.values()) for name, of in others.items()},
        "modules under 40 lines": sum(length < 40 for length in lengths),
        "modules over 250 lines": sum(length > 250 for length in lengths),
        "lines of a function's body, median": statistics.median(bodies),
        "lines of a function's body, 90 % have at most": statistics.quantiles(bodies, n=10, method="inclusive")[-1],
        "types that hold a number with an interval": len(interval_types(found)),
        "types and functions that tell something": len(telling(found)),
        "annotations by a dict of anything": dict_annotations(found),
        "subscripts by a string": string_subscripts(found),
        "public functions of " + ", ".join(DOCUMENTED): len(list(public_functions(found))),
        **{f"docstrings with {part}, %": round(share) for part, share in docstrings(found).items()},
        "wrong turns of a reader with twelve questions": sum(wrong_turns(names, *one) for one in QUESTIONS.items()),
        "pages": len(words_per_page(root)),
        "words in pages": sum(words_per_page(root).values()),
    }


def main() -> None:
    """Print the table, then cycles, types, words a page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("checkout", nargs="?", type=Path, default=ROOT)
    parser.add_argument("--walks", action="store_true", help="also run four stages and count what they pass through")
    asked = parser.parse_args()
    root = asked.checkout.resolve()
    for title, value in (summary(root) | (walks(root) if asked.walks else {})).items():
        print(f"{value:8g}  {title}")
    graph = import_graph(modules(root))
    for group in cycles(graph):
        print("cycle:", " ".join(group))
    print("number with an interval:", *interval_types(modules(root)))
    print("tell something:", *telling(modules(root)))
    for page, count in sorted(words_per_page(root).items(), key=lambda item: -item[1])[:12]:
        print(f"{count:8d}  {page}")


if __name__ == "__main__":
    main()
