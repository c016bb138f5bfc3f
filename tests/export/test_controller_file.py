"""The controller as a file: what it carries, and that it is read back as what was exported or not at all."""

import json
from pathlib import Path

import pytest

from pneucli.errors import InputError
from pneucli.export import c_source, controller_program, export_files
from tests.design import axis

CONTROLLER = axis.controller()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    export_files.write_replay(tmp_path, CONTROLLER, "demo", "float64")
    return tmp_path


def changed(folder: Path, **values: object) -> Path:
    path = folder / controller_program.FILE_NAME
    path.write_text(json.dumps(json.loads(path.read_text()) | values))
    return path


def test_it_carries_hash_parameters_and_states(folder: Path) -> None:
    plain = json.loads((folder / controller_program.FILE_NAME).read_text())
    assert plain["hash"] in c_source.header(CONTROLLER, "demo")
    assert plain["parameters"]["values"] == dict(CONTROLLER.values)
    assert plain["states"][3:5] == ["S_X", "S_V"]
    assert plain["units"]["C_MASS"] == "kg"


@pytest.mark.parametrize(
    "name", [controller_program.FILE_NAME, "pneucli_controller.c", "pneucli_controller.st", "pneucli_replay.csv"]
)
def test_any_file_of_the_export_names_its_controller(folder: Path, name: str) -> None:
    found = controller_program.load_controller(folder / name, "here")
    assert found.controller == CONTROLLER
    assert found.precision == "float64"


def test_another_controller_or_precision_has_another_hash() -> None:
    other = CONTROLLER.with_values(C_KP=CONTROLLER.values["C_KP"] * (1.0 + 1e-15))
    hashes = {
        controller_program.controller_hash(*one)
        for one in [(CONTROLLER, "float64"), (CONTROLLER, "float32"), (other, "float64")]
    }
    assert len(hashes) == 3


@pytest.mark.parametrize(
    ("values", "found"),
    [
        ({"program_hash": "0"}, "written by another program"),
        ({"hash": "0"}, "numbers were changed"),
        ({"precision": "float32"}, "numbers were changed"),
        ({"schema": "other"}, "no exported controller"),
        ({"law": "none"}, "none"),
        ({"parameters": {}}, "lacks"),
    ],
)
def test_what_is_not_as_it_was_exported_is_refused(folder: Path, values: dict[str, object], found: str) -> None:
    with pytest.raises(InputError, match="here") as error:
        controller_program.load_controller(changed(folder, **values), "here")
    assert found in error.value.found


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        controller_program.load_controller(tmp_path / "pneucli_controller.c", "here")
