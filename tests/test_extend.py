"""The examples of ``docs/development/extend.md``: each is one file, in a copy of the program or in a package."""

import json
import os
import pkgutil
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from pneucli.cli import commands
from pneucli.cli.program import build

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "docs" / "examples"
FOLDERS = {
    "greet.py": "cli/commands",
    "rod_wiper.py": "physics/effects",
    "proportional.py": "controller/laws",
    "lab_log.py": "io/formats",
    "supply_sag.py": "plausibility/detectors",
}
PACKAGE = (ROOT / "tests" / "extensions", EXAMPLES)  # a distribution with entry points, and its modules


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the program with each example in its folder."""
    folder = tmp_path_factory.mktemp("copy")
    shutil.copytree(ROOT / "pneucli", folder / "pneucli", ignore=shutil.ignore_patterns("__pycache__"))
    for name, place in FOLDERS.items():
        shutil.copy(EXAMPLES / name, folder / "pneucli" / place / name)
    return folder


@pytest.fixture(params=["a file in a copy of the program", "an entry point of a package"])
def where(request: pytest.FixtureRequest, copy: Path) -> list[Path]:
    """Folders from which Python imports the program with the examples; the tests come from the last one."""
    return [copy, ROOT] if "copy" in request.param else [*PACKAGE, ROOT]


def python(where: list[Path], *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, where))}
    return subprocess.run(
        [sys.executable, *words],
        cwd=where[0], env=environment, capture_output=True, text=True, encoding="utf-8", check=False,
    )  # fmt: skip


def test_a_command_runs_and_is_listed_last(where: list[Path]) -> None:
    ran = python(where, "-m", "pneucli", "greet", "axis-7.toml", "--json")
    assert (ran.returncode, json.loads(ran.stdout)) == (0, {"schema": "greeting/1", "pipeline": "axis-7.toml"})
    last = python(where, "-m", "pneucli", "--help").stdout.partition("  explain ")[2]
    assert re.search(r"\n  greet +Says good morning to a pipeline\.\n", last)
    assert "Example: pneucli greet axis-7/pipeline.toml" in python(where, "-m", "pneucli", "greet", "--help").stdout


EFFECT = """
from pneucli.physics.effects import all_effects, catalogue
from pneucli.simulate.build import source
print(catalogue()["rod-wiper"].title, "rod-wiper" in all_effects())
print("rod_wiper__dry_factor" in source([catalogue()["rod-wiper"]], compiled=False))
"""


def test_an_effect_is_listed_and_enters_the_equations(where: list[Path]) -> None:
    shown = python(where, "-m", "pneucli", "effects", "rod-wiper", "--json")
    assert json.loads(shown.stdout)["effects"][0]["title"] == "Wiper that scrapes on the way back", shown.stderr
    ran = python(where, "-c", EFFECT)
    assert ran.stdout.splitlines() == ["Wiper that scrapes on the way back True", "True"], ran.stderr


LAW = """
import numpy as np
from pneucli.controller import layout as at
from pneucli.controller.laws import LAWS
from pneucli.design.bandwidths import choose_bandwidths
from pneucli.design.control_laws import DesignData, controller_for
from pneucli.export import c_source, structured_text
from tests.design import axis

best, wanted = axis.controller(), axis.REQUIREMENTS
data = DesignData(best, wanted, choose_bandwidths(axis.model(), wanted, best.values), surface_slope=1.0)
made = controller_for("proportional", data)
c, s = made.vector(), np.zeros(at.L_STATES)
for _ in range(3):
    LAWS["proportional"].step(0.101, 0.1, 3e5, 3e5, s, c)
print(list(LAWS)[-1], made.own[1], s[at.S_FORCE] > 0.0)
print("proportional_step(" in c_source.source(made, "axis"))
print("pneucli_proportional_step" in structured_text.source(made, "axis"))
"""


def test_a_law_is_designed_sampled_and_exported(where: list[Path]) -> None:
    ran = python(where, "-c", LAW)
    assert ran.stdout.splitlines() == ["proportional 1000.0 True", "True", "True"], ran.stderr


READ = """
import sys
from pathlib import Path
from pneucli.cli.docs import formats_table
from pneucli.io.formats import formats, open_raw
from pneucli.io.raw_file import ColumnRequest, RawFile
reader = open_raw(RawFile(Path(sys.argv[1]), {}))
((time, p1),) = reader.batches([ColumnRequest(0), ColumnRequest(1)])
print(list(reader.names), dict(reader.units), time.tolist(), p1.tolist())
print("our logger (`.lab`)" in formats_table())
"""


def test_a_format_is_recognised_read_and_listed(where: list[Path], tmp_path: Path) -> None:
    about = {"rate": 500, "channels": [{"name": "p1", "unit": "bar", "scale": 0.5}]}
    content = b"\n".join([b"LABLOG 1", json.dumps(about).encode(), b"\x02\x00\xff\xff"])
    (tmp_path / "run.lab").write_bytes(content)
    ran = python(where, "-c", READ, str(tmp_path / "run.lab"))
    read = "['time', 'p1'] {0: 's', 1: 'bar'} [0.0, 0.002] [1.0, -0.5]"
    assert ran.stdout.splitlines() == [read, "True"], ran.stderr
    (tmp_path / "run.lab").write_bytes(content[:-1])
    assert "cannot be read as lab log: ValueError" in python(where, "-c", READ, str(tmp_path / "run.lab")).stderr


DOUBTS = """
import numpy as np
from pneucli.cli.docs import detectors_table
from pneucli.plausibility import findings
from pneucli.recording import Recording, Rig
time = 0.01 * np.arange(400)
signals = {"p1": 3e5 + 1e5 * np.sin(time), "p_supply": 7e5 - 1.2e5 * time, "u": np.sin(time)}
tank = Recording("tank", "valve", "train", time, signals)
print([one.found for one in findings([tank], Rig(), {}) if one.check == "supply-sag"])
print("| `supply-sag` |" in detectors_table())
"""


def test_a_detector_speaks_and_is_listed(where: list[Path]) -> None:
    ran = python(where, "-c", DOUBTS)
    assert ran.stdout.splitlines() == ["['the supply falls by 80 %']", "True"], ran.stderr


DIGEST = "from pneucli.pipeline.manifest import program_digest; print(program_digest())"


def test_a_package_makes_results_stale_and_one_that_cannot_be_loaded_is_said() -> None:
    """What is left out stops no other command, and a command of the program asks no other package."""
    assert python([*PACKAGE, ROOT], "-c", DIGEST).stdout != python([EXAMPLES, ROOT], "-c", DIGEST).stdout
    ran = python([*PACKAGE, ROOT], "-m", "pneucli", "greet", "axis-7.toml")
    assert (ran.returncode, ran.stdout) == (0, "good morning, axis-7\n")
    assert (
        "entry point torn of pneucli.commands: pneucli_torn:COMMAND cannot be loaded: ModuleNotFoundError" in ran.stderr
    )
    assert "torn" not in python([*PACKAGE, ROOT], "-m", "pneucli", "explain", "E042").stderr


def test_each_file_of_the_folder_is_the_command_of_its_name_in_the_order_of_their_places() -> None:
    names = [one.name for one in pkgutil.iter_modules(commands.__path__)]
    places = {name: import_module(f"{commands.__name__}.{name}").COMMAND.place for name in names}
    assert [one.name for one in build().registered_commands] == sorted(names, key=places.__getitem__)
    assert len(set(places.values())) == len(places)


def test_the_page_shows_the_examples_as_they_are() -> None:
    page = (ROOT / "docs" / "development" / "extend.md").read_text(encoding="utf-8")
    for name, place in FOLDERS.items():
        assert f"`{name}` in `pneucli/{place}`" in page
        assert f"```python\n{(EXAMPLES / name).read_text(encoding='utf-8')}```" in page
