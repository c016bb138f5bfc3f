"""The controller as C99: one header, one source, and a program that replays test vectors through them."""

from __future__ import annotations

from importlib.resources import files
from types import FunctionType

from pneucli import __version__
from pneucli.design import layout, plant, step
from pneucli.design.controller import Controller
from pneucli.export.translate import c_functions, callees_first

NAME = "pneucli_controller"
REPLAY = "pneucli_replay.c"


def header(controller: Controller, pipeline: str) -> str:
    """Return ``pneucli_controller.h``."""
    return _template("controller.h").format(
        version=__version__,
        pipeline=_comment(pipeline),
        period=repr(controller.period),
        states=len(layout.STATE),
        valves=2 if controller.values["C_TWO_VALVES"] > 0.5 else 1,
    )


def source(controller: Controller, pipeline: str) -> str:
    """Return ``pneucli_controller.c``; every equation in it is translated from :mod:`pneucli.design.step`."""
    known = [f for module in (plant, step) for f in vars(module).values() if isinstance(f, FunctionType)]
    numbers = [f"    {controller.values[n]!r}, /* {n} */" for n in layout.PARAMETERS if n != "C_TABLE"]
    for title, table in controller.tables().items():
        numbers += [f"    /* {title}: V at (i / {len(table) - 1})^2 of the largest area */"]
        numbers += [f"    {', '.join(map(repr, map(float, table[i : i + 6])))}," for i in range(0, len(table), 6)]
    return (
        _template("controller.c")
        .replace("@VERSION@", __version__)
        .replace("@PIPELINE@", _comment(pipeline))
        .replace("@STATE@", ", ".join(layout.STATE))
        .replace("@PARAMETERS@", ", ".join(layout.PARAMETERS))
        .replace("@NUMBERS@", "\n".join(numbers))
        .replace("@FUNCTIONS@", c_functions(callees_first(step.step, known)))
    )


def replay_program() -> str:
    """Return ``pneucli_replay.c``, which runs a replay file through the controller and says how far it is off."""
    return _template("replay.c")


def _template(name: str) -> str:
    return files("pneucli.export").joinpath("templates", name).read_text(encoding="utf-8")


def _comment(text: str) -> str:
    """Return text that cannot end a comment of C."""
    return text.replace("*/", "* /")
