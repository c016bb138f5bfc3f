"""The structured text: its grammar, its numbers, and, where a compiler for it is installed, its commands."""

import os
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

from pneucli.controller.laws import LAWS
from pneucli.export import export_files, structured_text
from pneucli.export.command_player import PlayedRecording, PlayerLimits, player_text
from pneucli.plan.bench import hold
from tests.design import axis

blark = pytest.importorskip("blark.parse", reason="needs blark")
COMPILER, LIBRARY = shutil.which("iec2c"), os.environ.get("MATIEC_INCLUDE_PATH", "/usr/share/matiec/lib")
DRIVER = Path(__file__).parent / "drive_st.c"
KEYWORDS = Path(__file__).parent / "words_of_st.txt"
EVERY = 15  # of the functions that are parsed: all of them take 40 s


@cache
def text(law: str = "best", arrangement: str = "one-chamber") -> str:
    return structured_text.source(axis.bench_of_laws(arrangement)[1][law], "demo *) evil")


def parts(law: str) -> list[str]:
    """The types, each function, and the block, with three numbers in the table of many."""
    short = re.sub(r":= \[.*?\]", ":= [1.0, -2.5E-7, 3.0]", text(law), flags=re.DOTALL)
    return re.split(r"(?=^\(\* )", short, flags=re.MULTILINE)[1:]


@pytest.mark.parametrize("law", ["best", "pdc"])
def test_it_is_grammatical(law: str) -> None:
    every = parts(law)
    chosen = {every[0], every[-1], *every[1::EVERY]}
    for part in chosen:
        assert blark.parse_source_code(part).exception is None, part


def test_the_parser_would_find_a_fault() -> None:
    assert blark.parse_source_code(parts("pid")[-1].replace("END_IF;", "", 1)).exception is not None


def test_no_condition_is_chosen_from_two_values_that_were_both_calculated() -> None:
    assert "SEL(" not in text()
    part = next(p for p in parts("best") if "FUNCTION pneucli_sector_switching_term " in p)
    assert re.search(r"IF \(v_total > 0\.0\) THEN\s+v1 := \(\(v_s1 \+ v_s2\) / v_total\);", part)


@pytest.mark.parametrize(
    ("value", "written"),
    [(1.0, "1.0"), (1e-05, "1.0E-5"), (2.5e-300, "2.5E-300"), (-3e5, "-300000.0"), (1e22, "1.0E22")],
)
def test_numbers_have_a_point_and_are_read_back_to_the_last_bit(value: float, written: str) -> None:
    assert structured_text.number(value) == written
    assert float(written) == value


def test_every_number_of_the_controller_is_in_it() -> None:
    found = re.search(r":= \[(.*?)\]", text(), flags=re.DOTALL)
    assert found is not None
    assert [float(one) for one in found[1].split(",")] == list(axis.bench_of_laws()[1]["best"].vector())


def declared_names(code: str) -> list[str]:
    """Each name that a program declares, once a scope: functions, blocks, types and their variables."""
    bare = re.sub(r"\(\*.*?\*\)", "", code, flags=re.DOTALL)
    return re.findall(r"^ +(\w+) : \w", bare, flags=re.MULTILINE) + re.findall(
        r"^FUNCTION(?:_BLOCK)? (\w+)", bare, flags=re.MULTILINE
    )


def player() -> str:
    segments = [PlayedRecording("motion", True, 100.0, (hold(0.1, 0.1),), 0.05)]
    limits = PlayerLimits(
        null=5.0, command=4.0, position=None, pressure=None, soft_start=0.1, max_speed=None, mirrored=True
    )
    return player_text("pneucli_player.st", segments, limits, "demo")


@pytest.mark.parametrize("what", [*LAWS, "player"])
def test_no_name_is_a_word_of_a_dialect_or_refused_by_the_standard(what: str) -> None:
    """Keywords of IEC 61131-3 (ST and IL, all editions), of CODESYS, TwinCAT, SCL, Control Expert and Studio 5000."""
    code = player() if what == "player" else text(what)
    names = declared_names(code)
    assert len(names) > 20
    words = set(KEYWORDS.read_text(encoding="utf-8").upper().split())
    assert not [name for name in names if name.upper() in words]
    assert not [name for name in names if name.endswith("_") or "__" in name]
    reachable = [
        n.upper() for n in re.findall(r"^(?:FUNCTION|FUNCTION_BLOCK|    PNEUCLI_\w+)\b ?(\w*)", code, flags=re.M)
    ]
    assert len(set(filter(None, reachable))) == len([*filter(None, reachable)])


def test_a_name_that_is_a_word_of_a_dialect_would_be_found() -> None:
    words = set(KEYWORDS.read_text(encoding="utf-8").upper().split())
    assert {"S", "RESET", "END_VAR", "LREAL", "BEGIN"} <= words


def test_every_name_begins_with_the_prefix() -> None:
    code = structured_text.source(axis.bench_of_laws()[1]["pdc"], "demo", "axis1")
    bare = re.sub(r"\(\*.*?\*\)", "", code, flags=re.DOTALL)
    assert "pneucli" not in bare.lower()
    outside = re.findall(r"^(?:FUNCTION|FUNCTION_BLOCK) (\w+)|^TYPE\s+(\w+)", bare, flags=re.MULTILINE)
    assert len(outside) > 20
    assert all("".join(names).lower().startswith("axis1_") for names in outside)


def test_python_without_a_counterpart_is_refused() -> None:
    def loops(s, c):
        """Loops."""
        while s[0] < c[0]:
            s[0] = c[1]

    with pytest.raises(ValueError, match="no counterpart"):
        structured_text.st_functions([loops], {})


@pytest.mark.skipif(COMPILER is None, reason="needs iec2c of matiec")
@pytest.mark.parametrize(
    ("law", "arrangement"), [("best", "one-chamber"), ("pid", "5/3"), ("compensated", "two"), ("pdc", "two")]
)
def test_compiled_it_gives_the_simulated_commands(law: str, arrangement: str, tmp_path: Path) -> None:
    model, made = axis.bench_of_laws(arrangement)
    export_files.write_st(tmp_path, made[law], model, axis.BENCH, "demo")
    assert COMPILER is not None
    subprocess.run(
        [COMPILER, "-f", "-I", LIBRARY, "-T", tmp_path, tmp_path / structured_text.FILE_NAME],
        check=True,
        capture_output=True,
    )
    shutil.copy(DRIVER, tmp_path)
    build = ["gcc", "-w", "-O1", "-I", f"{LIBRARY}/C", tmp_path / DRIVER.name, "-lm", "-o", tmp_path / "drive"]
    subprocess.run(build, check=True)
    told = subprocess.run(
        [tmp_path / "drive", tmp_path / export_files.REPLAY_ST_FILE], check=True, capture_output=True, text=True
    )
    samples, worst = told.stdout.split()
    assert int(samples) == 68_000
    assert float(worst) <= 1e-9
