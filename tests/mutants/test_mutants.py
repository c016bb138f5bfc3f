"""The mutants themselves: seeded, meaningful, tried against the right tests, and never left behind."""

import ast
from pathlib import Path

import pytest

from tests.mutants.places import Mutant, sample
from tests.mutants.run import BUDGET, ROOT, Contexts, mutated

SOURCE = '''"""Words."""

LIMIT = 3.0
Array = list[float]
__all__ = ["half"]


def half(x: float, more: Array | None = None) -> float:
    """Return half of x."""
    if x > LIMIT:
        return max(0.5 * x, 1.0)
    return sum(more or []) - 0.5 * x
'''


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    (tmp_path / "code").mkdir()
    (tmp_path / "code" / "half.py").write_text(SOURCE)
    return tmp_path


def drawn(tree: Path, number: int, seed: int) -> list[Mutant]:
    return sample(tree, {"code": number}, seed)


def test_a_seed_repeats_its_sample_and_another_seed_draws_another(tree: Path) -> None:
    one, again, other = ([m.text for m in drawn(tree, 5, seed)] for seed in (1, 1, 2))
    assert one == again
    assert one != other


def test_a_mutant_is_python_that_differs_in_what_is_run(tree: Path) -> None:
    found = drawn(tree, 1000, 1)
    original = ast.dump(ast.parse(SOURCE))
    assert len(found) > 10
    for mutant in found:
        assert ast.dump(ast.parse(mutant.text)) != original
        before, after = mutant.diff
        assert before != after
        assert "Array =" not in before
        assert "__all__" not in before
        assert "Words" not in before


def known(seconds: dict[str, float], lines: dict[str, dict[str, list[str]]], **shares: list[str]) -> Contexts:
    """Contexts of the tests whose time is known, and of the fixtures that they share."""
    fixtures = {one for mine in shares.values() for one in mine}
    return Contexts(seconds, {t: shares.get(t, []) for t in seconds if t not in fixtures}, lines)


def at(file: str, *lines: int) -> Mutant:
    return Mutant(file, lines, "", "")


def test_a_line_meets_the_tests_that_run_it_fastest_first_within_the_time() -> None:
    contexts = known(
        {"slow": 0.9 * BUDGET, "quick": 0.1, "long": 0.5 * BUDGET, "other": 0.1},
        {"code/half.py": {"3": ["slow", "quick", "long"], "9": ["other"]}},
    )
    assert contexts.tests(at("code/half.py", 3, 3)) == ["quick", "long"]
    assert contexts.tests(at("code/half.py", 4, 9)) == ["other"]


def test_lines_of_a_shared_fixture_belong_to_all_its_tests() -> None:
    """Its time counts once, whichever of them comes first: three of four here, with one of a tenth without it."""
    contexts = known(
        {"made": 0.5 * BUDGET, "a": 0.1 * BUDGET, "b": 0.2 * BUDGET, "c": 0.4 * BUDGET, "d": 0.1 * BUDGET},
        {"code/half.py": {"3": ["made", "d"], "4": ["a"]}},
        a=["made"], b=["made"], c=["made"],
    )  # fmt: skip
    assert contexts.tests(at("code/half.py", 3)) == ["d", "a", "b"]
    assert contexts.tests(at("code/half.py", 4)) == ["a"]


def test_untraced_lines_belong_to_the_tests_of_their_folder() -> None:
    contexts = known(
        {"a": 0.1, "b": 0.2, "c": 0.1}, {"code/x.py": {"1": ["b"]}, "code/y.py": {"1": ["a"]}, "z/x.py": {"1": ["c"]}}
    )
    assert contexts.tests(at("code/x.py", 7, 7)) == ["a", "b"]


def test_a_test_too_slow_for_the_time_is_tried_where_it_is_the_only_one() -> None:
    assert known({"slow": 2 * BUDGET}, {"code/x.py": {"1": ["slow"]}}).tests(at("code/x.py", 1)) == ["slow"]


def test_a_mutant_is_taken_back_whatever_happens(tree: Path) -> None:
    file = tree / "code" / "half.py"
    kept = tree / "code" / "__pycache__" / "half.nbi"
    kept.parent.mkdir()
    kept.write_text("compiled")
    before = file.stat().st_mtime_ns
    mutant = drawn(tree, 1, 1)[0]

    def meddle() -> None:
        with mutated(tree, mutant):
            assert file.read_text() == mutant.text
            assert not kept.exists()
            kept.write_text("compiled with the fault")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        meddle()
    assert file.read_text() == SOURCE
    assert file.stat().st_mtime_ns == before
    assert kept.read_text() == "compiled"


def test_the_cache_of_a_mutated_function_and_its_callers_is_removed(tree: Path) -> None:
    """Of the file itself and of those of its folder that import it, directly or through another."""
    code = tree / "code"
    (code / "near.py").write_text("from code.half import half\n")
    (code / "far.py").write_text("from code.near import half\n")
    (code / "other.py").write_text("import math\n")
    (code / "__pycache__").mkdir()
    for name in ("half", "near", "far", "other"):
        (code / "__pycache__" / f"{name}.half-3.nbi").write_text("compiled")
    with mutated(tree, drawn(tree, 1, 1)[0]):
        assert [one.name for one in (code / "__pycache__").glob("*.nbi")] == ["other.half-3.nbi"]
    assert len(list((code / "__pycache__").glob("*.nbi"))) == 4


def test_accepted_survivors_are_still_in_the_code() -> None:
    from tests.mutants.report import accepted

    for file, was, _ in accepted():
        text = (ROOT / file).read_text()
        assert all(line in text for line in was.splitlines()), (file, was)
