"""The controller as C99: one header, one source, and a program that replays test vectors through them."""

from __future__ import annotations

from importlib.resources import files

from pneucli import __version__
from pneucli.design import layout
from pneucli.design.callees import callees_first
from pneucli.design.controller import Controller
from pneucli.design.laws import LAWS
from pneucli.export.translate import c_functions
from pneucli.physics import gas

NAME = "pneucli_controller"
REPLAY = "pneucli_replay.c"


def header(controller: Controller, pipeline: str) -> str:
    """Return ``pneucli_controller.h``."""
    return _template("controller.h").format(
        version=__version__,
        pipeline=_comment(pipeline),
        period=repr(controller.period),
        law=LAWS[controller.law].title,
        states=len(layout.STATE) + len(LAWS[controller.law].states),
        valves=2 if controller.values["C_TWO_VALVES"] > 0.5 else 1,
    )


def source(controller: Controller, pipeline: str) -> str:
    """Return ``pneucli_controller.c``; every equation in it is translated from the law's own sample."""
    law = LAWS[controller.law]
    constants = [f"#define {name} {value!r}" for name, value in vars(gas).items() if isinstance(value, float)]
    numbers = [f"    {controller.values[n]!r}, /* {n} */" for n in layout.PARAMETERS if n != "C_TABLE"]
    for title, table in controller.tables().items():
        numbers += [f"    /* {title}: V at (i / {len(table) - 1})^2 of the largest area */"]
        numbers += [f"    {', '.join(map(repr, map(float, table[i : i + 6])))}," for i in range(0, len(table), 6)]
    numbers += _own(controller)
    return (
        _template("controller.c")
        .replace("@VERSION@", __version__)
        .replace("@PIPELINE@", _comment(pipeline))
        .replace("@STATE@", ", ".join([*layout.STATE, *law.states]))
        .replace("@PARAMETERS@", ", ".join(layout.PARAMETERS))
        .replace("@OWN@", "".join(f"enum {{ {name} = {law.constants[name]} }};\n" for name in law.parameters))
        .replace("@STEP@", law.step.__name__)
        .replace("@NUMBERS@", "\n".join(numbers))
        .replace("@FUNCTIONS@", "\n".join([*constants, "", c_functions(callees_first(law.step))]))
    )


def _own(controller: Controller) -> list[str]:
    """Return the lines of the numbers and tables that the law has beside the common ones."""
    names, own = LAWS[controller.law].parameters, list(map(repr, controller.own))
    lines = [f"    {value}, /* {name} */" for name, value in zip(names, own, strict=False)]
    rest = own[len(names) :]
    return lines + [f"    {', '.join(rest[i : i + 6])}," for i in range(0, len(rest), 6)]


def replay_program() -> str:
    """Return ``pneucli_replay.c``, which runs a replay file through the controller and says how far it is off."""
    return _template("replay.c")


def _template(name: str) -> str:
    return files("pneucli.export").joinpath("templates", name).read_text(encoding="utf-8")


def _comment(text: str) -> str:
    """Return text that cannot end a comment of C."""
    return text.replace("*/", "* /")
