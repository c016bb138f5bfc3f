"""What other repositories take from this one: the GitHub Action, the hook for pre-commit, the example workflow."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.test_packaging import need_registry

ROOT = Path(__file__).parents[1]
ACTION: dict[str, Any] = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
STEPS = ACTION["runs"]["steps"]
HOOK: dict[str, Any] = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))[0]
pytestmark = pytest.mark.skipif(shutil.which("sh") is None, reason="no POSIX shell")


def stand_in(folder: Path, name: str, script: str) -> None:
    """A command of that name on the path."""
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    (folder / name).chmod(0o755)


def step(name: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run the shell of a step of the action in a folder, as a runner would."""
    found = next(one for one in STEPS if one.get("name") == name)
    stated = {key: value for key, value in found["env"].items() if "${{" not in value}
    outside = {**os.environ, **stated, "ACTION_PATH": str(ROOT), "RUNNER_TEMP": str(folder / "temp"), **variables}
    outside |= {"PATH": f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"}
    outside |= {"GITHUB_OUTPUT": str(folder / "output"), "GITHUB_STEP_SUMMARY": str(folder / "shown")}
    return subprocess.run(
        ["sh", "-e", "-c", found["run"]], cwd=folder, env=outside, capture_output=True, text=True, check=False
    )


def bench(folder: Path, *names: str) -> None:
    (folder / "pipelines").mkdir()
    for name in names:
        (folder / "pipelines" / f"{name}.toml").write_text("")


# writes a summary and ends with the code that the file's name begins with
RUN = """case "$(basename "$2")" in 0*) code=0;; 1*) code=1;; *) code=2; echo "error: $2: no file" >&2; exit 2;; esac
mkdir -p "$4/report"; echo "# summary of $2" > "$4/report/summary.md"; exit $code"""


@pytest.mark.parametrize(
    ("names", "code"), [(["0_good"], 0), (["0_good", "1_check"], 1), (["2_input", "1_check"], 2), ([], 2)]
)
def test_the_action_runs_every_pipeline_and_ends_with_the_worst_code(
    tmp_path: Path, names: list[str], code: int
) -> None:
    stand_in(tmp_path / "bin", "pneucli", RUN)
    bench(tmp_path, *names)
    done = step("Run the pipelines", tmp_path, PIPELINES="pipelines/*.toml")
    assert done.returncode == code, done.stderr
    shown = (tmp_path / "shown").read_text(encoding="utf-8")
    for name in names:
        expected = "error: pipelines" if name.startswith("2") else f"## summary of pipelines/{name}.toml"
        assert expected in shown
    outputs = dict(line.split("=", 1) for line in (tmp_path / "output").read_text(encoding="utf-8").splitlines())
    assert Path(outputs["summary"]).read_text(encoding="utf-8") == shown
    assert set(outputs) == set(ACTION["outputs"])


def test_the_comment_of_the_last_run_is_replaced(tmp_path: Path) -> None:
    stand_in(tmp_path / "bin", "gh", f'echo "$@" > {tmp_path}/said')
    done = step("Comment on the pull request", tmp_path, PULL_REQUEST="7", SUMMARY="summary.md")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "said").read_text().split() == [
        *("pr", "comment", "7", "--body-file", "summary.md", "--edit-last", "--create-if-none")
    ]


def test_the_action_installs_the_extras_that_are_asked_for(tmp_path: Path) -> None:
    stand_in(tmp_path / "bin", "python", f'echo "$@" >> {tmp_path}/said')
    for extras in ("", "tdms,hdf5"):
        step("Install pneucli", tmp_path, EXTRAS=extras)
    plain, some = (tmp_path / "said").read_text().splitlines()
    assert plain.endswith(f"install {ROOT}")
    assert some.endswith(f"install {ROOT}[tdms,hdf5]")


def test_the_example_workflow_uses_inputs_and_outputs_that_the_action_has() -> None:
    text = (ROOT / "docs" / "examples" / "pneucli-action.yml").read_text(encoding="utf-8")
    steps = yaml.safe_load(text)["jobs"]["pipelines"]["steps"]
    own = next(one for one in steps if "/pneucli@" in one["uses"])
    assert set(own["with"]) <= set(ACTION["inputs"])
    assert set(re.findall(r"steps\.pneucli\.outputs\.(\w+)", text)) <= set(ACTION["outputs"])


def hook(*files: Path) -> subprocess.CompletedProcess[str]:
    """Run the hook's command on files, as pre-commit would."""
    command = [sys.executable, "-m", *HOOK["entry"].split(), *map(str, files)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, encoding="utf-8", check=False)


def test_the_hook_checks_every_pipeline_file_that_is_committed(tmp_path: Path) -> None:
    good, bad = ROOT / "pipelines" / "demo.toml", tmp_path / "bad.toml"
    bad.write_text('[pipeline]\nname = "bad"\n[rig]\nsuply_pressure = "7 bar"\n')
    assert hook(good).returncode == 0
    done = hook(good, bad)
    assert done.returncode == 2
    assert "supply_pressure" in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("path", "taken"), [("pipelines/a.toml", True), ("rigs/7/pipelines/a.toml", True), ("pyproject.toml", False)]
)
def test_the_hook_takes_the_files_of_folders_of_pipelines(path: str, taken: bool) -> None:
    assert bool(re.search(HOOK["files"], path)) is taken


@pytest.mark.slow
def test_pre_commit_installs_and_runs_the_hook(tmp_path: Path) -> None:
    need_registry(tmp_path / "asked")
    pytest.importorskip("pre_commit", reason="no pre-commit")
    work = tmp_path / "work"
    shutil.copytree(ROOT / "fixtures" / "demo", work / "fixtures" / "demo")
    (work / "pipelines").mkdir()
    shutil.copy(ROOT / "pipelines" / "demo.toml", work / "pipelines")
    for words in (["init", "--quiet"], ["add", "."]):
        subprocess.run(["git", *words], cwd=work, check=True)
    command = [sys.executable, "-m", "pre_commit", "try-repo", str(ROOT), HOOK["id"], "--all-files", "--verbose"]
    outside = {**os.environ, "PRE_COMMIT_HOME": str(tmp_path / "home")}
    done = subprocess.run(command, cwd=work, env=outside, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Passed" in done.stdout
