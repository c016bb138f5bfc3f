"""What of the program an exported controller consists of in any language, and the file that tells it."""

import ast
import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from types import FunctionType
from typing import Any

from pneucli.controller import layout
from pneucli.controller.commissioning import commission, run_commissioning, watch_limit_cycle
from pneucli.controller.laws import LAWS, find_law
from pneucli.controller.laws.base import callees_first
from pneucli.controller.operation import (
    active_reference,
    close_valves,
    enable,
    finish_commands,
    pause,
    reset,
    set_supply,
)
from pneucli.controller.parameters import Controller
from pneucli.controller.reference import set_level
from pneucli.errors import InputError
from pneucli.export.type_inference import syntax_tree
from pneucli.physics import gas
from pneucli.version import __version__

MAX_PREFIX = 24  # C99 tells external names apart by their first 31 characters
OPERATION_FUNCTIONS: tuple[Callable[..., Any], ...] = (
    set_supply,
    set_level,
    enable,
    pause,
    reset,
    commission,
    run_commissioning,
    watch_limit_cycle,
    active_reference,
    finish_commands,
    close_valves,
)  # what is called around a law


def controller_functions(law: str) -> list[FunctionType]:
    """Return the functions that a law and its operation need, each after those that it calls."""
    roots: list[Callable[..., Any]] = [LAWS[law].step, *OPERATION_FUNCTIONS]
    return list({f.__name__: f for root in roots for f in callees_first(root)}.values())


def physical_constants() -> dict[str, float]:
    """Return the physical constants by name."""
    return {name: value for name, value in vars(gas).items() if isinstance(value, float)}


def state_names(law: str) -> list[str]:
    """Return the names of all states, in the order in which they stand."""
    return [*layout.STATE, *LAWS[law].states]


PREFIX = "pneucli"  # of the names of an exported program


def checked_prefix(text: str, where: str) -> str:
    """Return the prefix of an exported program's names. Raises InputError where a language would refuse them."""
    if re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", text) and 2 <= len(text) <= MAX_PREFIX:
        return text
    wanted = f"2 to {MAX_PREFIX} small letters and digits with a letter first, single underscores between them"
    raise InputError(where, f'"{text}"', wanted, "for example axis1", code="E001")


def named(text: str, prefix: str) -> str:
    """Return a text in which the program's names begin with another prefix."""
    return text.replace(f"{PREFIX}_", f"{prefix}_").replace(f"{PREFIX}_".upper(), f"{prefix}_".upper())


def fill_template(name: str, prefix: str = PREFIX, **values: str) -> str:
    """Return a template with its names begun by ``prefix``, and with what stands between @ and @ filled in."""
    text = named(files("pneucli.export").joinpath("templates", name).read_text(encoding="utf-8"), prefix)
    for key, value in values.items():
        text = text.replace(f"@{key}@", value)
    return text


def _executable_text(function: FunctionType) -> str:
    tree = syntax_tree(function)
    tree.body = tree.body[1:] if ast.get_docstring(tree) else tree.body
    return ast.unparse(tree)


def program_hash(law: str) -> str:
    """Return the hash of all that is executed: a controller is replayed by the program that it was written from.

    Its comments and docstrings do not count.
    """
    text = "\n".join(_executable_text(f) for f in controller_functions(law))
    return hashlib.sha256(f"{text}\n{state_names(law)}\n{physical_constants()}".encode()).hexdigest()


def controller_hash(controller: Controller, precision: str) -> str:
    """Return the hash of program, numbers, tables and precision."""
    about = f"{program_hash(controller.law)}\n{precision}\n{controller.to_json()}"
    return hashlib.sha256(about.encode()).hexdigest()


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
