"""The controller as a file that is read back: what was exported, so that a log of it can be replayed."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pneucli.controller import layout
from pneucli.controller.laws import LAWS, find_law
from pneucli.controller.parameters import Controller
from pneucli.errors import InputError
from pneucli.export.controller_program import controller_hash, program_hash, state_names
from pneucli.version import __version__

FILE_NAME = "pneucli_controller.json"
SCHEMA = "pneucli/controller/1"


@dataclass(frozen=True)
class ExportedController:
    """A controller as it was exported: its numbers, its precision (``float64``, ``float32``), and the hash of both."""

    controller: Controller
    precision: str
    hash: str


def to_json(controller: Controller, pipeline: str, precision: str) -> str:
    """Return the text of the file: hash, parameters with their units, tables, and the names of the states."""
    about = {
        "schema": SCHEMA,
        "hash": controller_hash(controller, precision),
        "program_hash": program_hash(controller.law),
        "program": __version__,
        "pipeline": pipeline,
        "law": controller.law,
        "title": LAWS[controller.law].title,
        "precision": precision,
        "period_s": controller.period,
        "states": state_names(controller.law),
        "units": {name: layout.UNITS.get(name, "1") for name in controller.values},
        "parameters": asdict(controller),
    }
    return json.dumps(about, indent=1) + "\n"


def load_controller(path: Path, where: str) -> ExportedController:
    """Return the controller that was exported into the folder of ``path``; any file of that folder names it.

    Raises InputError, which ``where`` begins, where there is none, it was changed, or its program is not this one's.
    """
    path = path if path.suffix == ".json" else path.parent / FILE_NAME
    try:
        plain = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        wanted = f"a file that pneucli export wrote, with {FILE_NAME} in its folder"
        raise InputError(where, f"{path}: cannot be read ({type(error).__name__})", wanted, code="E072") from error
    if not isinstance(plain, dict) or plain.get("schema") != SCHEMA:
        raise InputError(
            where, f"{path} is no exported controller", f"one of schema {SCHEMA}", 'or write "unknown"', code="E072"
        )
    try:
        law = find_law(plain["law"], where).name
        found = ExportedController(
            Controller.from_json(json.dumps(plain["parameters"])), plain["precision"], plain["hash"]
        )
    except (KeyError, TypeError) as error:
        raise InputError(
            where, f"{path} lacks {error}", f"one of schema {SCHEMA}", "export it again", code="E072"
        ) from error
    _require_same(plain, found, law, f"{where}: {path}")
    return found


def _require_same(plain: dict[str, Any], found: ExportedController, law: str, where: str) -> None:
    mend = 'export it again, load it onto the machine, and record anew; or write controller = "unknown"'
    if plain.get("program_hash") != program_hash(law):
        raise InputError(
            where, f"written by another program (pneucli {plain.get('program')})", "this one's", mend, code="E072"
        )
    if found.hash != controller_hash(found.controller, found.precision):
        raise InputError(
            where, "its numbers were changed: they do not have its hash", "the file as exported", mend, code="E072"
        )
