"""What a user installs: wheel and sdist, built from the checkout and tried in fresh environments."""

import email
import os
import re
import shutil
import site
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from email.message import Message
from pathlib import Path

import pytest

from pneucli.errors import InputError
from pneucli.imports import library_of_extra

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
README = (ROOT / "README.md").read_text(encoding="utf-8")
FIXTURES = "fixtures/friction_hysteresis"


def run(*command: str | Path, cwd: Path, shell: bool = False) -> str:
    """What a command prints on standard output; it must end well."""
    outside = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    words = " ".join(map(str, command)) if shell else list(map(str, command))
    done = subprocess.run(
        words, cwd=cwd, shell=shell, env=outside, capture_output=True, text=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0, f"{words}\n{done.stdout}\n{done.stderr}"
    return done.stdout


EXTRAS = re.findall(
    r'library_of_extra\(\s*"(\w+)", "(\w+)"',
    "".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "pneucli").rglob("*.py"))),
)


@pytest.mark.parametrize(("library", "extra"), sorted(set(EXTRAS)))
def test_a_missing_library_is_named_with_the_extra_that_installs_it(
    library: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    packages = {
        "distributed": "dask[distributed]",
        "cvxpy": "cvxpy-base",
        "nptdms": "npTDMS",
        "python_calamine": "python-calamine",
    }
    assert any(one.startswith(packages.get(library, library)) for one in PROJECT["optional-dependencies"][extra])
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError, match=rf"pip install 'pneucli\[{extra}\]'"):
        library_of_extra(library, extra, "here")


def test_all_extras_that_code_asks_for_are_tried() -> None:
    assert len(set(EXTRAS)) == 9


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The sdist, and the wheel that is built from the sdist, as an index would have them."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, ROOT, cwd=folder)
    return {"wheel": next(folder.glob("*.whl")), "sdist": next(folder.glob("*.tar.gz"))}


class Environment:
    """A fresh virtual environment without pip of its own."""

    def __init__(self, folder: Path) -> None:
        venv.create(folder, with_pip=False, symlinks=os.name != "nt")
        self.bin = folder / ("Scripts" if os.name == "nt" else "bin")
        self.packages = next(folder.glob("[Ll]ib/python*/site-packages"), folder / "Lib" / "site-packages")

    def install(self, *what: str | Path) -> None:
        python = self.bin / "python"
        command = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", *what]
        run(*command, "--disable-pip-version-check", cwd=self.bin)

    def borrow_dependencies(self) -> None:
        """Take all other packages from the environment of the tests, after those of this one."""
        paths = [*site.getsitepackages(), site.getusersitepackages()]
        (self.packages / "borrowed.pth").write_text("\n".join(paths), encoding="utf-8")


def need_registry(folder: Path) -> None:
    """Skip where the package registry does not answer."""
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", str(folder), "tomlkit"]
    asked = subprocess.run([*command, "--timeout", "5", "--retries", "0"], capture_output=True, check=False)
    if asked.returncode:
        pytest.skip("the package registry does not answer")


def metadata(wheel: Path) -> Message:
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        return email.message_from_bytes(archive.read(name))


def test_the_wheel_has_every_file_of_the_program_and_nothing_else(built: dict[str, Path]) -> None:
    with zipfile.ZipFile(built["wheel"]) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    files = (path for path in (ROOT / "pneucli").rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    assert packed == {path.relative_to(ROOT).as_posix() for path in files}


def test_the_wheel_says_whose_it_is_as_the_licence_does(built: dict[str, Path]) -> None:
    about = metadata(built["wheel"])
    holder = re.search(r"Copyright \(c\) \d+ (.+)", (ROOT / "LICENSE").read_text(encoding="utf-8"))
    assert holder is not None
    assert about["Author"] == holder[1]
    assert about["License-Expression"] == "MIT"
    assert about.get_all("License-File") == ["LICENSE"]
    assert set(about.get_all("Classifier", [])) == set(PROJECT["classifiers"])


def test_the_sdist_brings_what_its_tests_need(built: dict[str, Path]) -> None:
    with tarfile.open(built["sdist"]) as archive:
        packed = {name.partition("/")[2] for name in archive.getnames()}
    assert {"LICENSE", "Makefile", "tests/test_packaging.py", f"{FIXTURES}/driven_1.csv", "docs/index.md"} <= packed


def test_the_wheel_starts_in_an_environment_of_its_own(built: dict[str, Path], tmp_path: Path) -> None:
    environment = Environment(tmp_path / "venv")
    environment.install("--no-deps", built["wheel"])
    environment.borrow_dependencies()
    pneucli = environment.bin / "pneucli"
    code = "import pneucli; print(pneucli.__file__)"
    assert Path(run(environment.bin / "python", "-c", code, cwd=tmp_path).strip()).is_relative_to(environment.packages)
    version = built["wheel"].name.split("-")[1]
    assert run(pneucli, "--version", cwd=tmp_path) == f"pneucli {version}\n"
    run(pneucli, "init", "rig", cwd=tmp_path)
    assert "friction-hysteresis" in run(pneucli, "effects", cwd=tmp_path)


def blocks(kind: str) -> list[str]:
    """The fenced blocks of one kind in the README's walk."""
    walk = README.partition("## A walk through")[2].partition("## How often")[0]
    return re.findall(rf"```{kind}\n(.*?)```", walk, re.DOTALL)


def edited(text: str, statement: str) -> str:
    """A pipeline file with the tables of the README's second step in place of its own.

    The recordings of that step are those of its file; other recordings stay.
    """
    for table in re.split(r"\n(?=\[)", statement.strip()):
        head = table.partition("\n")[0].partition("  #")[0]
        own = re.search(r'file = ".*"', table)
        for part in re.split(r"\n(?=\[)", text):
            if part.startswith(head) and (own is None or own[0] in part):
                text = text.replace(part, table + "\n")
    return text


def walk(bin_folder: Path, folder: Path) -> list[str]:
    """Do what the README's walk says, in a fresh folder; return the commands."""
    shutil.copytree(ROOT / FIXTURES, folder / FIXTURES)
    done = []
    for line in [line for block in blocks("console") for line in block.splitlines() if line.startswith("$ ")]:
        command = line[2:].partition("  #")[0].strip()
        if not command.startswith("pneucli open"):  # no browser
            done.append(command)
            run(f"{bin_folder}{os.sep}{command}", cwd=folder, shell=True)
        if command.startswith("pneucli init"):
            file = folder / "axis-7" / "pipeline.toml"
            file.write_text(edited(file.read_text(encoding="utf-8"), blocks("toml")[0]), encoding="utf-8")
    return done


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["wheel", "sdist"])
def test_the_readmes_walk_from_the_registry(kind: str, built: dict[str, Path], tmp_path: Path) -> None:
    need_registry(tmp_path / "asked")
    environment = Environment(tmp_path / "venv")
    environment.install(built[kind])
    if kind == "wheel":
        commands = walk(environment.bin, tmp_path)
        found = {command.split()[1] for command in commands}
        assert {"init", "compare", "diagnose", "add", "history", "run", "status"} <= found
    assert run(environment.bin / "pneucli", "--version", cwd=tmp_path).startswith("pneucli ")


@pytest.mark.slow
@pytest.mark.parametrize("tool", ["uv", "pipx"])
def test_the_tools_that_the_readme_names_install_it(
    tool: str, built: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    need_registry(tmp_path / "asked")
    assert f"{tool} " in README
    environment = Environment(tmp_path / "venv")
    environment.install(tool)
    places = {"UV_TOOL_DIR": "tools", "UV_TOOL_BIN_DIR": "bin", "PIPX_HOME": "home", "PIPX_BIN_DIR": "bin"}
    for name, place in places.items():
        monkeypatch.setenv(name, str(tmp_path / place))
    words = ["tool", "install"] if tool == "uv" else ["install"]
    run(environment.bin / tool, *words, built["wheel"], cwd=tmp_path)
    assert run(tmp_path / "bin" / "pneucli", "--version", cwd=tmp_path).startswith("pneucli ")


def requirements(lines: list[str]) -> dict[str, str]:
    """Names and versions of requirements, as conda and pip write them alike."""
    pairs = [re.match(r"([\w.-]+)\s*(\S*)$", line.strip()) for line in lines]
    return {pair[1].lower(): pair[2] for pair in pairs if pair}


def test_the_conda_recipe_needs_what_the_wheel_needs() -> None:
    recipe = (ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    section = recipe.partition("  run:\n")[2].partition("\n\n")[0]
    needed = requirements([line.strip().removeprefix("- ") for line in section.splitlines()])
    conda_names = {"matplotlib": "matplotlib-base"}
    wanted = {conda_names.get(name, name): bound for name, bound in requirements(PROJECT["dependencies"]).items()}
    assert needed == wanted | {"python": PROJECT["requires-python"]}


def test_the_version_of_the_conda_recipe_is_that_of_the_program() -> None:
    recipe = (ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    stated = re.search(r'^  version: "(.+)"$', recipe, re.MULTILINE)
    assert stated is not None
    assert f'"{stated[1]}"' in (ROOT / "pneucli" / "version.py").read_text(encoding="utf-8")


def test_the_conda_recipe_is_one_file_that_says_of_the_program_what_pyproject_says() -> None:
    assert [path.name for path in (ROOT / "packaging" / "conda").iterdir()] == ["recipe.yaml"]
    recipe = (ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]
    host = requirements([line.strip().removeprefix("- ") for line in recipe.partition("  host:\n")[2].splitlines()[:3]])
    assert {name: host.get(name) for name in requirements(build["requires"])} == requirements(build["requires"])
    assert host["python"] == PROJECT["requires-python"]
    fields = dict(re.findall(r"^  (name|license|license_file|summary): (.+)$", recipe, re.MULTILINE))
    assert fields == {
        "name": PROJECT["name"],
        "license": PROJECT["license"],
        "license_file": PROJECT["license-files"][0],
        "summary": PROJECT["description"],
    }
    assert [f"{name} = {place}" for name, place in PROJECT["scripts"].items()] == re.findall(
        r"- (pneucli = .+)", recipe
    )
