"""The examples in docstrings give what they print, and every public function of physics and tp has one."""

import ast
import doctest
import importlib
from pathlib import Path
from types import ModuleType

import pytest

from tests import structure

ROOT = Path(__file__).parents[1]
PACKAGES = ("physics", "tp", "identify", "simulate", "design", "controller", "closed_loop", "noise", "messages")
SPECIFIED = ("physics", "tp")  # packages in which every public function states arguments, result and an example
MODULES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for package in PACKAGES
    for path in (ROOT / "pneucli" / package).rglob("*.py")
)


def failures(module: ModuleType) -> tuple[int, str]:
    """Run the examples of a module; return how many fail, and the report."""
    report: list[str] = []
    runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.NORMALIZE_WHITESPACE)
    for test in doctest.DocTestFinder(exclude_empty=True).find(module):
        runner.run(test, out=report.append)
    return runner.failures, "".join(report)


@pytest.mark.parametrize("name", MODULES)
def test_examples_give_what_they_print(name: str) -> None:
    count, report = failures(importlib.import_module(name))
    assert count == 0, report


def test_an_example_with_a_wrong_result_fails() -> None:
    module = ModuleType("example")
    module.__doc__ = ">>> 1 + 1\n3\n"
    assert failures(module)[0] == 1


def public_functions(package: str) -> dict[str, str]:
    """Docstring of every public function of a package by its full name."""
    return {
        f"{path.relative_to(ROOT)}: {node.name}": ast.get_docstring(node) or ""
        for path in sorted((ROOT / "pneucli" / package).rglob("*.py"))
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
    }


@pytest.mark.parametrize("package", SPECIFIED)
def test_every_public_function_states_arguments_result_and_an_example(package: str) -> None:
    incomplete = {
        name: [part for part in ("Returns:", ">>>") if part not in text]
        for name, text in public_functions(package).items()
    }
    incomplete |= {
        f"{name} (arguments)": ["Args:"]
        for name, text in public_functions(package).items()
        if "Args:" not in text and _takes_arguments(name)
    }
    assert {name: parts for name, parts in incomplete.items() if parts} == {}


def _takes_arguments(name: str) -> bool:
    path, function = name.split(": ")
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    node = next(n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == function)
    return bool(node.args.args or node.args.kwonlyargs)


def parts(text: str, doc: str = "") -> dict[str, bool]:
    """What applies of a specification to the only function of a module."""
    module = structure.Module("pneucli.tp.one", text, ast.parse(f'"""{doc}"""\n{text}'))
    (function,) = (node for node in module.tree.body if isinstance(node, ast.FunctionDef))
    return structure.specification(module, function)


def test_a_specification_has_only_what_applies() -> None:
    assert parts("def f(model: Model) -> str: ...") == {"arguments": True}
    assert parts("def f() -> None: ...") == {}
    bare = parts("def f(a: Array, b: float) -> Array:\n  if b: raise ValueError\n  return a * b")
    assert bare == dict.fromkeys(("arguments", "units", "shapes", "errors", "source"), False)
    assert parts("def f(a: float, b: float) -> float: return a / b")["doctest"] is False
    assert "doctest" not in parts("def f(a, s, c): return a / s[0]")


@pytest.mark.parametrize(
    ("part", "doc"),
    [
        ("arguments", "Return a at b."),
        ("units", "Return a force in N."),
        ("units", "Return a share."),
        ("shapes", "Return it, shape (n,)."),
        ("errors", "Raises:\n        ValueError: b is 0."),
        ("source", "Thesis (2.46)."),
        ("source", "References:\n        JCGM 100."),
        ("doctest", ">>> f(1.0, 2.0)"),
    ],
)
def test_each_part_of_a_specification_is_found(part: str, doc: str) -> None:
    types = "a: float, b: float" if part == "doctest" else "a: Array, b: float"
    body = f'def f({types}) -> float:\n    """{{}}"""\n    if b: raise ValueError\n    return a * b'
    assert not parts(body.format("Return something."))[part]
    assert parts(body.format(doc))[part]


def test_a_source_may_stand_at_the_module() -> None:
    body = "def f(a: float) -> float: return a * a"
    assert not parts(body, "Own.")["source"]
    assert parts(body, "Thesis 7.4.")["source"]


@pytest.fixture(scope="module")
def program() -> dict[str, structure.Module]:
    """The modules of the program, parsed."""
    return structure.modules()


def test_most_public_functions_state_all_that_applies(program: dict[str, structure.Module]) -> None:
    shares = structure.docstrings(program)
    assert shares["all that applies"] >= 90
    assert shares["errors"] == shares["doctest"] == 100


def test_a_reader_finds_by_names_what_he_looks_for(program: dict[str, structure.Module]) -> None:
    seen = structure.names_to_go_by(program)
    turns = {
        question: structure.wrong_turns(seen, question, answers) for question, answers in structure.QUESTIONS.items()
    }
    assert sum(turns.values()) <= 3, turns


def test_a_reader_opens_first_what_promises_most() -> None:
    texts = {"pneucli.a.clock": "", "pneucli.b.other": '"""The clock of a flow."""', "pneucli.c.plain": "def f(): ..."}
    seen = structure.names_to_go_by({n: structure.Module(n, text, ast.parse(text)) for n, text in texts.items()})
    assert structure.wrong_turns(seen, "clock", ("a.clock",)) == 0
    assert structure.wrong_turns(seen, "clocks", ("b.other",)) == 1
    assert structure.wrong_turns(seen, "flow clock", ("b.other",)) == 0
    assert structure.wrong_turns(seen, "clock", ("gone",)) == structure.PATIENCE
