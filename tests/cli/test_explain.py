"""Codes of errors: every fault that the program raises has one, and every code an example that really arises."""

from __future__ import annotations

import ast
import json
from functools import cache
from pathlib import Path

import pytest

import pneucli as package
from pneucli.cli.commands.explain import errors_page
from pneucli.fault_kinds import fault_kinds
from tests.cli.conftest import Command
from tests.cli.fault_examples import provoke

SOURCE = Path(package.__file__).parent
KINDS = fault_kinds()
RAISED = {"InputError", "NotApplicable"}


@cache
def faults() -> list[tuple[str, ast.Call]]:
    """Every place where a fault is raised, with the call that makes it."""
    return [
        (f"{path.relative_to(SOURCE)}:{node.lineno}", node)
        for path in sorted(SOURCE.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in RAISED
    ]


def code_of(call: ast.Call) -> str | None:
    """The code of a fault; "passed on" where it is that of another one."""
    for keyword in call.keywords:
        if keyword.arg == "code":
            return keyword.value.value if isinstance(keyword.value, ast.Constant) else "passed on"
        if keyword.arg is None:
            return "passed on"
    return None


def test_every_fault_has_a_code_that_is_explained() -> None:
    known = {*KINDS, "passed on"}
    assert [place for place, call in faults() if code_of(call) not in known] == []


def test_every_code_is_in_use() -> None:
    assert set(KINDS) - {code_of(call) for _, call in faults()} == set()


@pytest.mark.parametrize("code", KINDS)
def test_the_example_of_a_code_is_what_the_program_says(code: str, tmp_path: Path) -> None:
    exit_code, printed = provoke(KINDS[code].example, tmp_path)
    assert exit_code == 2
    assert f"[{code}]" in printed.splitlines()[0]
    assert printed == KINDS[code].example.output


def test_a_code_is_explained_on_the_terminal_and_on_the_page(pneucli: Command) -> None:
    told = pneucli("explain", "e042").out
    assert KINDS["E042"].found in told
    assert KINDS["E042"].example.output in told
    assert "## E042: A column that is not there" in errors_page()
    assert [line.split()[0] for line in pneucli("explain").out.splitlines()] == list(KINDS)
    assert json.loads(pneucli("explain", "E042", "--json").out)["kinds"][0]["code"] == "E042"


def test_an_unknown_code_is_an_input_error(pneucli: Command) -> None:
    result = pneucli("explain", "E142")
    assert result.code == 2
    assert '"E042"' in result.err


def test_the_code_is_in_the_json_of_an_error(pneucli: Command, tmp_path: Path) -> None:
    answer = json.loads(pneucli("compare", tmp_path / "no.toml", "--json").out)
    assert answer["error"]["code"] == "E002"
