"""Codes of errors: every fault that the program raises has one, and every code an example that really arises."""

import ast
import json
import shutil
from functools import cache
from pathlib import Path

import pytest

import pneucli as package
from pneucli.cli.commands.explain import errors_page, fault_kinds
from tests.cli.conftest import Command
from tests.cli.fault_examples import provoke

SOURCE = Path(package.__file__).parent
KINDS = fault_kinds()
RAISED = {"InputError", "NotApplicable", "require_known"}


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


# --- ``schema``, and ``effects`` of a pipeline file with effects of one's own


ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "rod_wiper.py"
OWN = """[pipeline]
name = "own"
[[recordings]]
file = "a.csv"
experiment = "friction"
use = "train"
[model]
plugins = ["rod_wiper.py"]
"""


def test_the_schema_is_printed_as_json(pneucli: Command) -> None:
    result = pneucli("schema")
    made = json.loads(result.out)
    assert made["$schema"].endswith("2020-12/schema")
    assert made == json.loads((ROOT / "docs" / "pipeline.schema.json").read_text(encoding="utf-8"))
    assert result.err == ""


def test_effects_of_a_pipeline_file_are_the_catalogues_and_its_own(pneucli: Command, tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(OWN)
    shutil.copy(EXAMPLE, tmp_path)
    listed = pneucli("effects", tmp_path / "own.toml", "--json")
    names = [one["name"] for one in json.loads(listed.out)["effects"]]
    assert {"rod-wiper", "stribeck"} <= set(names)
    told = pneucli("effects", tmp_path / "own.toml", "rod-wiper").out
    assert told.startswith("rod-wiper: Wiper that scrapes on the way back (part: cylinder)")
    assert "dry_factor" in told
    assert pneucli("effects", "stribeck").out.startswith("stribeck: ")
    unknown = pneucli("effects", "rod-wiper")
    assert unknown.code == 2


def test_a_fault_of_an_own_effect_is_an_input_error_that_names_its_file(pneucli: Command, tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(OWN)
    text = EXAMPLE.read_text(encoding="utf-8")
    (tmp_path / "rod_wiper.py").write_text(text.replace("gain * filled(x)", "gain * full(x)"))
    result = pneucli("effects", tmp_path / "own.toml", "rod-wiper")
    assert result.code == 2
    assert "rod_wiper.py" in result.err
    assert '"full"' in result.err
    assert "Traceback" not in result.err


def test_the_thesis_is_named_in_full_where_it_is_cited(pneucli: Command) -> None:
    told = pneucli("effects", "stribeck").out
    assert "K. Széll, Direct Modeling and Robust Control of a Servo-pneumatic System, PhD thesis" in told
