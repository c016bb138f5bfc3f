"""The controller as C99, in double or in float: a header, a source, and a program that replays test vectors.

The source is translated from the controller's restricted Python (:mod:`pneucli.controller.cascade`): functions of
scalars and of the arrays ``s`` and ``c``, assignments, ``if``, ``for`` over a ``range``, ``return``, conditional
expressions, arithmetic, comparisons, ``math``, ``min``, ``max``, ``int``. A local or argument annotated ``int`` is one,
everything else is real. Anything else raises ``ValueError``: no program is written that does something else.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pneucli.controller import layout
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.export.controller_program import (
    PREFIX,
    controller_functions,
    controller_hash,
    fill_template,
    physical_constants,
    state_names,
)
from pneucli.export.type_inference import COMMON_OPERATORS, InferredTypes, summary, syntax_tree
from pneucli.version import __version__

MATH_FUNCTIONS = ("fabs", "sqrt", "isfinite")  # of the controller; small targets have them
BUILT_IN = {"min": "smaller", "max": "larger", "int": "(int)"}
OPERATORS: dict[type[ast.AST], str] = {
    **COMMON_OPERATORS,
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.And: "&&",
    ast.Or: "||",
    ast.Not: "!",
    ast.USub: "-",
}
INDENT = "    "


@dataclass(frozen=True)
class Real:
    """How C writes real numbers: the type, and what stands behind its numbers and the functions of its library."""

    type: str = "double"
    suffix: str = ""

    def number(self, value: float) -> str:
        """Return a number as C writes it, to the last bit."""
        return f"{float(value)!r}{self.suffix}"

    def function(self, name: str) -> str:
        """Return the name of a function of ``math.h``; those that are macros serve every type."""
        return name if name == "isfinite" else name + self.suffix


DOUBLE, FLOAT = Real(), Real("float", "f")


def c_functions(functions: Iterable[Callable[..., Any]], real: Real = DOUBLE) -> str:
    """Return the functions as C99, each ``static``, in the order given (callees first)."""
    every = list(functions)
    changing: set[str] = set()  # functions that change the parameters, themselves or by what they call
    for tree in map(syntax_tree, every):
        if any(_changes_parameters(node, changing) for node in ast.walk(tree)):
            changing.add(tree.name)
    return "\n\n".join(c_function(f, real, constant=f.__name__ not in changing) for f in every)


def _changes_parameters(node: ast.AST, changing: Collection[str]) -> bool:
    match node:
        case ast.Assign(targets=[ast.Subscript(value=ast.Name(id="c"))]):
            return True
        case ast.Call(func=ast.Name(id=name)):
            return name in changing
    return False


def c_function(function: Callable[..., Any], real: Real = DOUBLE, *, constant: bool = True) -> str:
    """Return one function as C99. Raises ``ValueError`` for Python that has no counterpart here.

    ``constant``: whether it leaves the parameters as they are.
    """
    tree = syntax_tree(function)
    arrays = {"s": f"{real.type} *s", "c": f"{'const ' if constant else ''}{real.type} *c"}
    text = summary(tree)
    tree.body = tree.body[1:]
    return f"/* {text} */\n{c_definition(tree, CWriter(real), arrays)}"


def c_signature(tree: ast.FunctionDef, kinds: InferredTypes, real: Real, arrays: Mapping[str, str]) -> str:
    """Return the head of a function in C; ``arrays`` holds the declarations of arguments that are arrays."""
    given = ", ".join(
        arrays.get(name) or f"{'int' if name in kinds.whole else real.type} {name}" for name in kinds.arguments
    )
    return f"static {'void' if kinds.returns == 'nothing' else real.type} {tree.name}({given})"


def c_definition(
    tree: ast.FunctionDef, writer: CWriter, arrays: Mapping[str, str], local_arrays: Mapping[str, int] | None = None
) -> str:
    """Return a function as C99 from its tree, which has no docstring; ``local_arrays`` are its own, by their length."""
    kinds, real = InferredTypes(tree), writer.real
    lines = [c_signature(tree, kinds, real, arrays), "{"]
    groups = (("int", kinds.whole), (real.type, [*kinds.truth, *kinds.real]))
    lines += [f"{INDENT}{kind} {', '.join(names)};" for kind, all_ in groups if (names := kinds.locals(all_))]
    lines += [f"{INDENT}{real.type} {name}[{length}];" for name, length in (local_arrays or {}).items()]
    lines += [line for statement in tree.body for line in writer.statement(statement, 1)]
    return "\n".join([*lines, "}"])


@dataclass(frozen=True)
class CWriter:
    """Writes statements and expressions; ``math`` names the functions of ``math.h`` that are there."""

    real: Real
    math: Collection[str] = MATH_FUNCTIONS

    def statement(self, node: ast.stmt, depth: int) -> list[str]:  # noqa: PLR0911 - one case a kind of statement
        """Return the lines of a statement."""
        pad, written = INDENT * depth, self.expression
        match node:
            case ast.Assign(targets=[target], value=value):
                return [f"{pad}{written(target)} = {written(value)};"]
            case ast.AnnAssign(target=target, annotation=ast.Name(id="int"), value=ast.expr() as value):
                return [f"{pad}{written(target)} = (int)({written(value)});"]
            case ast.AugAssign(target=target, op=op, value=value):
                return [f"{pad}{written(target)} {OPERATORS[type(op)]}= {written(value)};"]
            case ast.Return(value=value):
                return [f"{pad}return {written(value)};" if value is not None else f"{pad}return;"]
            case ast.Expr(value=ast.Call() as call):
                return [f"{pad}{written(call)};"]
            case ast.For(
                target=ast.Name(id=i), iter=ast.Call(func=ast.Name(id="range"), args=[*start, stop]), orelse=[]
            ) if len(start) < 2:
                first = written(start[0]) if start else "0"
                lines = [f"{pad}for ({i} = {first}; {i} < {written(stop)}; ++{i}) {{"]
                return [*lines, *self.block(node.body, depth), f"{pad}}}"]
            case ast.If(test=test, body=body, orelse=orelse):
                lines = [f"{pad}if ({written(test)}) {{", *self.block(body, depth)]
                if orelse:
                    lines += [f"{pad}}} else {{", *self.block(orelse, depth)]
                return [*lines, f"{pad}}}"]
        raise ValueError(f"no counterpart in C: {ast.unparse(node)}")

    def block(self, body: Iterable[ast.stmt], depth: int) -> list[str]:
        """Return the lines of an indented block."""
        return [line for statement in body for line in self.statement(statement, depth + 1)]

    def expression(self, node: ast.expr) -> str:  # noqa: PLR0911 - one case a kind of expression
        """Return an expression."""
        written = self.expression
        match node:
            case ast.Name(id=name):
                return name
            case ast.Constant(value=bool() as value):
                return str(int(value))
            case ast.Constant(value=int() as value):
                return repr(value)
            case ast.Constant(value=float() as value):
                return self.real.number(value)
            case ast.Subscript(value=array, slice=index):
                return f"{written(array)}[{written(index)}]"
            case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
                return f"({written(left)} {OPERATORS[type(op)]} {written(right)})"
            case ast.UnaryOp(op=op, operand=operand) if type(op) in OPERATORS:
                return f"({OPERATORS[type(op)]}{written(operand)})"
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in OPERATORS:
                return f"({written(left)} {OPERATORS[type(op)]} {written(right)})"
            case ast.BoolOp(op=op, values=values):
                return "(" + f" {OPERATORS[type(op)]} ".join(map(written, values)) + ")"
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return f"({written(test)} ? {written(body)} : {written(orelse)})"
            case ast.Call(func=function, args=arguments, keywords=[]):
                return f"{self.callee(function)}({', '.join(map(written, arguments))})"
        raise ValueError(f"no counterpart in C: {ast.unparse(node)}")

    def callee(self, node: ast.expr) -> str:
        """Return the name of a called function."""
        match node:
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in self.math:
                return self.real.function(name)
            case ast.Name(id=name):
                return BUILT_IN.get(name, name)
        raise ValueError(f"no counterpart in C: {ast.unparse(node)}")


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
