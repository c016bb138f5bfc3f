"""Write the controller's restricted Python as structured text (IEC 61131-3): functions, and one function block.

What C does by the way is written out: a condition within an expression becomes an ``IF`` before its statement (``SEL``
would evaluate both sides, and divide by zero), a whole number that meets a real one is converted, every function
returns something and is called in an expression, places in arrays are numbers, with their names as comments.
"""

import ast
from collections.abc import Callable, Iterable, Mapping
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

TYPES = {"whole": "DINT", "truth": "BOOL", "real": "LREAL", "nothing": "BOOL"}
BUILT_IN = {"min": "MIN", "max": "MAX", "int": "TRUNC", "fabs": "ABS", "sqrt": "SQRT"}
OPERATORS: dict[type[ast.AST], str] = {
    **COMMON_OPERATORS,
    ast.Eq: "=",
    ast.NotEq: "<>",
    ast.And: "AND",
    ast.Or: "OR",
}
INDENT = "    "
ARRAYS = {"s": "STATE", "c": "NUMBERS"}  # types behind the prefix
MAX_FINITE = 1e30  # beyond it a reading is none; what is no number compares as false
FILE_NAME = "pneucli_controller.st"


def source(controller: Controller, pipeline: str, prefix: str = PREFIX) -> str:
    """Return ``pneucli_controller.st``: types, functions, and the function block ``PNEUCLI_CONTROLLER``."""
    law = LAWS[controller.law]
    places: dict[str, float] = {name: i for i, name in enumerate(state_names(controller.law))}
    places |= {name: i for i, name in enumerate(layout.PARAMETERS)} | law.constants | physical_constants()
    vector = [number(value) for value in controller.vector()]
    rows = [", ".join(vector[i : i + 6]) for i in range(0, len(vector), 6)]
    return fill_template(
        "controller.st",
        prefix,
        VERSION=__version__,
        PIPELINE=pipeline.replace("*)", "* )"),
        PERIOD=repr(controller.period),
        LAW=law.title,
        HASH=controller_hash(controller, "float64"),
        LAST_STATE=str(layout.L_STATES - 1),
        LAST_NUMBER=str(len(vector) - 1),
        FUNCTIONS=st_functions(controller_functions(controller.law), places | {"L_STATES": layout.L_STATES}, prefix),
        NUMBERS=",\n".join(f"        {row}" for row in rows),
        STEP=law.step.__name__,
        **{name: str(i) for i, name in enumerate(layout.STATE)},
    )


def st_functions(functions: Iterable[Callable[..., Any]], constants: Mapping[str, float], prefix: str = PREFIX) -> str:
    """Return the functions as structured text, in the order given (callees first).

    ``constants``: the constants that they name: whole places in the arrays, and physical ones. The names of functions
    and types begin with ``prefix``, those of arguments and locals with ``v``: none can be a word of the language.
    """
    every = list(functions)
    trees = [syntax_tree(function) for function in every]
    truths = frozenset(t.name for t in trees if InferredTypes(t).returns == "truth")
    nothing = frozenset(t.name for t in trees if InferredTypes(t, truths).returns == "nothing")
    takes = {t.name: _argument_kinds(t, truths) for t in trees}
    return "\n\n".join(_Writer(tree, truths, nothing, takes, constants, prefix).function() for tree in trees)


def number(value: float) -> str:
    """Return a real number as structured text writes it, to the last bit of a double."""
    text = repr(float(value))
    mantissa, e, exponent = text.partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{f'E{int(exponent)}' if e else ''}"


def _argument_kinds(tree: ast.FunctionDef, truths: frozenset[str]) -> list[str]:
    kinds = InferredTypes(tree, truths)
    return [kinds.of(ast.Name(id=name)) for name in kinds.arguments]


class _Writer:
    """Writes one function."""

    def __init__(
        self,
        tree: ast.FunctionDef,
        truths: frozenset[str],
        nothing: frozenset[str],
        takes: Mapping[str, list[str]],
        places: Mapping[str, float],
        prefix: str,
    ) -> None:
        self._tree, self._kinds = tree, InferredTypes(tree, truths)
        self._nothing, self._takes, self._places = nothing, takes, places
        self._prefix = f"{prefix}_"
        self._chosen: list[str] = []  # kinds of the conditions within expressions so far

    def function(self) -> str:
        """Return the function's text. Raises ``ValueError`` for Python that has no counterpart here."""
        kinds, name = self._kinds, self._tree.name
        body = [line for statement in self._tree.body[1:] for line in self._statement(statement, 1)]
        scalars = [a for a in kinds.arguments if a not in ARRAYS]
        given = [f"{self._name(a)} : {TYPES[kinds.of(ast.Name(id=a))]};" for a in scalars]
        arrays = [f"{self._name(a)} : {self._prefix.upper()}{ARRAYS[a]};" for a in kinds.arguments if a in ARRAYS]
        own = dict.fromkeys(kinds.locals([*kinds.whole, *kinds.truth, *kinds.real]))
        local = [f"{self._name(n)} : {TYPES[kinds.of(ast.Name(id=n))]};" for n in own]
        local += [f"v{i} : {TYPES[kind]};" for i, kind in enumerate(self._chosen, 1)]
        for answer, kind in (("v_done", "BOOL"), ("v_ignored", "LREAL")):
            local += [f"{answer} : {kind};"] * any(line.lstrip().startswith(f"{answer} :=") for line in body)
        last = [f"{INDENT}{self._prefix}{name} := TRUE;"] if kinds.returns == "nothing" else []
        head = f"(* {summary(self._tree)} *)\nFUNCTION {self._prefix}{name} : {TYPES[kinds.returns]}"
        blocks = [*_block("VAR_INPUT", given), *_block("VAR_IN_OUT", arrays), *_block("VAR", local)]
        return "\n".join([head, *blocks, *body, *last, "END_FUNCTION"])

    def _is_nothing(self, call: ast.Call) -> bool:
        return isinstance(call.func, ast.Name) and call.func.id in self._nothing

    def _name(self, name: str) -> str:
        return f"v_{name.strip('_')}"

    def _statement(self, node: ast.stmt, depth: int) -> list[str]:
        """Return the lines of a statement, the conditions within its expressions before it."""
        pad = INDENT * depth
        before: list[str] = []
        match node:
            case ast.Assign(targets=[target], value=value) | ast.AnnAssign(target=target, value=ast.expr() as value):
                wanted = self._kinds.of(target)
                lines = [f"{self._expression(target, before)} := {self._as(value, wanted, before)};"]
            case ast.AugAssign(target=target, op=op, value=value):
                changed, wanted = self._expression(target, before), self._kinds.of(target)
                lines = [f"{changed} := {changed} {OPERATORS[type(op)]} {self._as(value, wanted, before)};"]
            case ast.Return(value=None):
                lines = [f"{self._prefix}{self._tree.name} := TRUE;", "RETURN;"]
            case ast.Return(value=ast.expr() as value):
                given = self._as(value, self._kinds.returns, before)
                lines = [f"{self._prefix}{self._tree.name} := {given};", "RETURN;"]
            case ast.Expr(value=ast.Call() as call):
                answer = "v_done" if self._kinds.of(call) == "truth" or self._is_nothing(call) else "v_ignored"
                lines = [f"{answer} := {self._expression(call, before)};"]
            case ast.For(
                target=ast.Name(id=i), iter=ast.Call(func=ast.Name(id="range"), args=[stop]), body=body, orelse=[]
            ):
                lines = [f"FOR {self._name(i)} := 0 TO {self._expression(stop, before)} - 1 DO"]
                lines += [*self._lines(body), "END_FOR;"]
            case ast.If(test=test, body=body, orelse=orelse):
                lines = [f"IF {self._expression(test, before)} THEN", *self._lines(body)]
                lines += ["ELSE", *self._lines(orelse)] if orelse else []
                lines += ["END_IF;"]
            case _:
                raise ValueError(f"no counterpart in structured text: {ast.unparse(node)}")
        return [pad + line for line in [*before, *lines]]

    def _lines(self, body: Iterable[ast.stmt]) -> list[str]:
        return [line for statement in body for line in self._statement(statement, 1)]

    def _as(self, node: ast.expr, wanted: str, before: list[str]) -> str:
        """Return an expression as a kind of number: a whole one becomes real where that is wanted."""
        text = self._expression(node, before)
        if wanted == "real" and self._kinds.of(node) == "whole":
            return f"DINT_TO_LREAL({text})"
        return text

    def _expression(self, node: ast.expr, before: list[str]) -> str:  # noqa: PLR0911 - one case a kind of expression
        match node:
            case ast.Name(id=name) if name in self._places:
                value = self._places[name]
                return f"{value} (* {name} *)" if isinstance(value, int) else number(value)
            case ast.Name(id=name):
                return self._name(name)
            case ast.Constant(value=bool() as value):
                return str(value).upper()
            case ast.Constant(value=int() as value):
                return repr(value)
            case ast.Constant(value=float() as value):
                return number(value)
            case ast.Subscript(value=array, slice=index):
                return f"{self._expression(array, before)}[{self._expression(index, before)}]"
            case ast.BinOp(left=left, op=op, right=right) | ast.Compare(left=left, ops=[op], comparators=[right]) if (
                type(op) in OPERATORS
            ):
                both = {self._kinds.of(left), self._kinds.of(right)}
                wanted = "whole" if both == {"whole"} and not isinstance(op, ast.Div) else "real"
                pair = (self._as(side, wanted, before) for side in (left, right))
                return f"({f' {OPERATORS[type(op)]} '.join(pair)})"
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return f"(-{self._expression(operand, before)})"
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return f"(NOT {self._expression(operand, before)})"
            case ast.BoolOp(op=op, values=values):
                return "(" + f" {OPERATORS[type(op)]} ".join(self._expression(v, before) for v in values) + ")"
            case ast.IfExp():
                return self._choice(node, before)
            case ast.Call(func=function, args=arguments, keywords=[]):
                return self._call(function, arguments, before)
        raise ValueError(f"no counterpart in structured text: {ast.unparse(node)}")

    def _choice(self, node: ast.IfExp, before: list[str]) -> str:
        """Put a condition within an expression before it; return where its value then stands."""
        kind = self._kinds.of(node)
        self._chosen.append(kind)
        name, sides = f"v{len(self._chosen)}", []
        test = self._expression(node.test, before)
        for side in (node.body, node.orelse):
            inner: list[str] = []
            value = self._as(side, kind, inner)
            sides.append([INDENT + line for line in [*inner, f"{name} := {value};"]])
        before += [f"IF {test} THEN", *sides[0], "ELSE", *sides[1], "END_IF;"]
        return name

    def _call(self, function: ast.expr, arguments: list[ast.expr], before: list[str]) -> str:
        match function:
            case ast.Attribute(value=ast.Name(id="math"), attr="isfinite"):
                return f"(ABS({self._expression(arguments[0], before)}) <= {number(MAX_FINITE)})"
            case ast.Attribute(value=ast.Name(id="math"), attr=name) | ast.Name(id=name) if name in BUILT_IN:
                whole = name == "int" or all(self._kinds.of(a) == "whole" for a in arguments)
                given = (self._as(a, "whole" if whole else "real", before) for a in arguments)
                return f"{BUILT_IN[name]}({', '.join(given)})"
            case ast.Name(id=name) if name in self._takes:
                given = (self._as(a, kind, before) for a, kind in zip(arguments, self._takes[name], strict=True))
                return f"{self._prefix}{name}({', '.join(given)})"
        raise ValueError(f"no counterpart in structured text: {ast.unparse(function)}")


def _block(kind: str, lines: list[str]) -> list[str]:
    """Return a block of variables, none where there are none."""
    return [kind, *(INDENT + line for line in lines), "END_VAR"] if lines else []
