"""The controller as C99: one header, one source, and a program that replays test vectors through them."""

from __future__ import annotations

from pneucli.controller import layout
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.export.c_translator import DOUBLE, FLOAT, Real, c_functions
from pneucli.export.controller_program import (
    PREFIX,
    controller_functions,
    controller_hash,
    fill_template,
    physical_constants,
    state_names,
)
from pneucli.version import __version__

BASE_NAME = "pneucli_controller"
REPLAY_FILE = "pneucli_replay.c"
PRECISIONS = {"float64": DOUBLE, "float32": FLOAT}


def header(controller: Controller, pipeline: str, precision: str = "float64", prefix: str = PREFIX) -> str:
    """Return ``pneucli_controller.h``."""
    return fill_template(
        "controller.h",
        prefix,
        VERSION=__version__,
        PIPELINE=_comment(pipeline),
        PERIOD=repr(controller.period),
        LAW=LAWS[controller.law].title,
        STATES=str(layout.L_STATES),
        COUNT=str(controller.vector().size),
        VALVES="2" if controller.values["C_TWO_VALVES"] > 0.5 else "1",
        REAL=PRECISIONS[precision].type,
        HASH=controller_hash(controller, precision),
    )


def source(controller: Controller, pipeline: str, precision: str = "float64", prefix: str = PREFIX) -> str:
    """Return ``pneucli_controller.c``; every equation in it is translated from the law's own sample."""
    law, real = LAWS[controller.law], PRECISIONS[precision]
    defined = [f"#define {name} {real.number(value)}" for name, value in physical_constants().items()]
    return fill_template(
        "controller.c",
        prefix,
        VERSION=__version__,
        PIPELINE=_comment(pipeline),
        STATE=", ".join(state_names(controller.law)),
        STATES=str(layout.L_STATES),
        PARAMETERS=", ".join(layout.PARAMETERS),
        OWN="".join(f"enum {{ {name} = {law.constants[name]} }};\n" for name in law.parameters),
        STEP=law.step.__name__,
        REAL=real.type,
        NUMBERS="\n".join(_numbers(controller, real)),
        FUNCTIONS="\n".join([*defined, "", c_functions(controller_functions(controller.law), real)]),
    )


def replay_program(precision: str = "float64", prefix: str = PREFIX) -> str:
    """Return ``pneucli_replay.c``, which runs a replay file through the controller and says how far it is off."""
    return fill_template("replay.c", prefix, REAL=PRECISIONS[precision].type)


def _numbers(controller: Controller, real: Real) -> list[str]:
    """Return the lines of all numbers and tables, those that the law has of its own last."""
    lines = [f"    {real.number(controller.values[n])}, /* {n} */" for n in layout.PARAMETERS if n != "C_TABLE"]
    for title, table in controller.tables().items():
        lines += [f"    /* {title}: V at (i / {len(table) - 1})^2 of the largest area */", *_rows(table, real)]
    names = LAWS[controller.law].parameters
    lines += [f"    {real.number(v)}, /* {n} */" for n, v in zip(names, controller.own, strict=False)]
    lines += _rows(controller.own[len(names) :], real)
    for i, row in enumerate(controller.family):
        title = f"member {i - 1}: delay and overshoot in s, gains" if i else "family: the places of its gains"
        lines += [f"    /* {title} */", *_rows(row, real)]
    return lines


def _rows(table: tuple[float, ...], real: Real) -> list[str]:
    return [f"    {', '.join(map(real.number, table[i : i + 6]))}," for i in range(0, len(table), 6)]


def _comment(text: str) -> str:
    """Return text that cannot end a comment of C."""
    return text.replace("*/", "* /")
