"""How the program starts: at once, in every way it may be called; and the page about it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pneucli
from pneucli.cli import docs
from tests.cli.toys import PIPELINE

ROOT = Path(__file__).parents[2]
HEAVY = ("numpy", "scipy", "pandas", "pyarrow", "matplotlib", "numba", "pydantic")

HELP_OF_ALL = f"""
import sys, typer
from pneucli.cli import main
from pneucli.cli.program import build
for words in [[], *([name] for name in typer.main.get_command(build()).commands)]:
    sys.argv = ["pneucli", *words, "--help"]
    try:
        main()
    except SystemExit as exit_:
        assert exit_.code == 0, words
    loaded = [name for name in {HEAVY} if name in sys.modules]
    assert not loaded, (words, loaded)
"""


def test_help_of_every_command_loads_nothing_heavy() -> None:
    result = subprocess.run([sys.executable, "-c", HELP_OF_ALL], cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    helps = result.stdout.split("Usage: pneucli")[1:]
    assert len(helps) >= 5
    assert all("Example: pneucli " in one or " COMMAND " in one for one in helps)


STAGES_THAT_DRAW_NOTHING = """
import importlib, sys
for name in ("ingest", "identify", "compare", "diagnose", "design", "simulate"):
    importlib.import_module(f"pneucli.stages.{name}")
    assert "matplotlib" not in sys.modules, name
"""


def test_stages_that_draw_nothing_load_no_plots() -> None:
    subprocess.run([sys.executable, "-c", STAGES_THAT_DRAW_NOTHING], cwd=ROOT, check=True)


def test_python_m_pneucli_works() -> None:
    for option in ("--version", "-V"):
        words = [sys.executable, "-m", "pneucli", option]
        assert subprocess.check_output(words, cwd=ROOT, text=True) == f"pneucli {pneucli.__version__}\n"


RUN_AND_TELL_ITS_TIME = """
import sys, time
from dataclasses import replace
from pneucli.cli import main
from pneucli.pipeline.graph import STAGES
STAGES.update({name: replace(stage, package="tests.cli.toys") for name, stage in STAGES.items()})
try:
    main()
finally:
    print(time.process_time(), file=sys.stderr)
"""


def test_a_run_with_nothing_to_do_answers_within_a_second(tmp_path: Path) -> None:
    """The issue's limit, in processor time from the interpreter's start: what an idle machine needs in wall time."""
    (tmp_path / "raw.csv").write_text("t,p\n0,1\n1,2\n")
    (tmp_path / "bench.toml").write_text(PIPELINE.replace("max = 1.5", "max = 9.0"))
    words = [sys.executable, "-c", RUN_AND_TELL_ITS_TIME, "run", str(tmp_path / "bench.toml")]
    subprocess.run(words, cwd=ROOT, capture_output=True, check=True)
    said = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stderr.splitlines()
    assert said[:-1] == ["everything is up to date"]
    assert float(said[-1]) < 1.0


def test_the_page_about_the_command_line_is_what_the_commands_say() -> None:
    page = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
    if page != docs.command_line_page():
        pytest.fail("docs/cli.md has drifted from the commands: run `make docs`")


@pytest.mark.parametrize("unbuffered", ["", "1"])  # what is printed meets the closed pipe at the end, or at once
@pytest.mark.parametrize("words", [["effects"], ["effects", "--json"], ["--help"]])
def test_a_closed_pipe_exits_with_zero(words: list[str], unbuffered: str) -> None:
    command, env = [sys.executable, "-m", "pneucli", *words], os.environ | {"PYTHONUNBUFFERED": unbuffered}
    with subprocess.Popen(command, cwd=ROOT, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()  # long before anything is printed
        assert (process.stderr.read(), process.wait()) == (b"", 0)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
def test_a_full_disk_is_reported() -> None:
    with open("/dev/full", "wb") as full:
        command = [sys.executable, "-m", "pneucli", "effects"]
        result = subprocess.run(command, cwd=ROOT, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert result.returncode == 2
    assert "No space left on device" in result.stderr
    assert "mend: free some space" in result.stderr
    assert "Traceback" not in result.stderr


def test_work_continues_if_nobody_reads_its_messages(tmp_path: Path) -> None:
    (tmp_path / "raw.csv").write_text("t,p\n" + "".join(f"{0.01 * i},{i % 3}\n" for i in range(40)))
    (tmp_path / "bench.toml").write_text(PIPELINE.replace('"test"', '"test"\nu = "1 V"'))
    command = [sys.executable, "-m", "pneucli", "ingest", str(tmp_path / "bench.toml"), "--json"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stderr.close()
        assert b"pneucli/ingest/1" in process.stdout.read()
        assert process.wait() == 0


def test_an_unreachable_cluster_is_reported_before_any_stage_runs(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text(PIPELINE)
    words = ["simulate", str(tmp_path / "bench.toml"), "--executor", "dask://127.0.0.1:1"]
    command = [sys.executable, "-m", "pneucli", *words]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert "no cluster answers" in result.stderr
    assert not (tmp_path / "artifacts").exists()


LOADED_BY_INGEST = """
import sys
from pneucli.cli import main
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
    import pandas
"""
NOT_FOR_A_STAGE = (
    "pandas",
    "pyarrow.dataset",
    "scipy.optimize",
    "scipy.interpolate",
    "scipy.integrate",
    "scipy.signal",
)


def test_ingest_loads_neither_compiler_nor_pandas(tmp_path: Path) -> None:
    """A stage of a second must not import for another one; what a plug-in imports is free."""
    folder = shutil.copytree(ROOT / "fixtures" / "valve_null", tmp_path / "rig")
    words = [sys.executable, "-c", LOADED_BY_INGEST, "ingest", str(folder / "pipeline.toml"), "--quiet"]
    said = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stderr.split()
    assert "pyarrow" in said
    assert not {"pandas", "pyarrow.dataset", "pyarrow.compute", "scipy.signal", "numba"} & {*said}


@pytest.mark.parametrize("stage", ["ingest", "identify", "diagnose"])
def test_a_stage_imports_no_solver_that_it_may_not_need(stage: str) -> None:
    code = f"import sys, pneucli.stages.{stage}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert f"pneucli.stages.{stage}" in loaded.split()
    assert not {*NOT_FOR_A_STAGE} & {*loaded.split()}
