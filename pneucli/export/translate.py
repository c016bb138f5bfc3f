"""Write the controller's restricted Python (:mod:`pneucli.design.step`) as C99.

What is translated: functions of scalars and of the arrays ``s`` and ``c``, assignments, ``if``, ``for`` over a
``range``, ``return``, conditional expressions, arithmetic, comparisons, ``math``, ``min``, ``max``, ``int``. A local or
argument annotated ``int`` is one, everything else is a double. Anything else raises ``ValueError``: no program is
written that does something else.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterable
from typing import Any

ARRAYS = {"s": "double *s", "c": "const double *c"}
LIBRARY = {"fabs": "fabs", "sqrt": "sqrt", "isfinite": "isfinite"}
BUILT_IN = {"min": "smaller", "max": "larger", "int": "(int)"}
OPERATORS: dict[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.And: "&&",
    ast.Or: "||",
    ast.Not: "!",
    ast.USub: "-",
}
INDENT = "    "


def c_functions(functions: Iterable[Callable[..., Any]]) -> str:
    """Return the functions as C99, each ``static``, in the order given (callees first)."""
    return "\n\n".join(c_function(function) for function in functions)


def c_function(function: Callable[..., Any]) -> str:
    """Return one function as C99. Raises ``ValueError`` for Python that has no counterpart here."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    arguments = [a.arg for a in tree.args.args]
    given = ", ".join(
        ARRAYS.get(a.arg) or f"{'int' if _is_int(a.annotation) else 'double'} {a.arg}" for a in tree.args.args
    )
    returns = any(isinstance(n, ast.Return) and n.value is not None for n in ast.walk(tree))
    lines = [f"/* {ast.get_docstring(tree)} */", f"static {'double' if returns else 'void'} {tree.name}({given})", "{"]
    lines += _declarations(tree, arguments)
    lines += [line for statement in tree.body[1:] for line in _statement(statement, 1)]
    return "\n".join([*lines, "}"])


def _declarations(tree: ast.FunctionDef, arguments: list[str]) -> list[str]:
    """Return the declarations of all locals, which Python does not have."""
    whole, real = [], []
    for node in ast.walk(tree):
        match node:
            case ast.AnnAssign(target=ast.Name(id=name), annotation=kind) if _is_int(kind):
                whole.append(name)
            case ast.For(target=ast.Name(id=name)):
                whole.append(name)
            case ast.Assign(targets=[ast.Name(id=name), *_]):
                real.append(name)
    whole = list(dict.fromkeys(whole))
    real = [name for name in dict.fromkeys(real) if name not in arguments and name not in whole]
    return [(INDENT + f"{kind} {', '.join(names)};") for kind, names in (("int", whole), ("double", real)) if names]


def _is_int(annotation: ast.expr | None) -> bool:
    return isinstance(annotation, ast.Name) and annotation.id == "int"


def _statement(node: ast.stmt, depth: int) -> list[str]:  # noqa: PLR0911 - one case a kind of statement
    pad = INDENT * depth
    match node:
        case ast.Assign(targets=[target], value=value):
            return [f"{pad}{_expression(target)} = {_expression(value)};"]
        case ast.AnnAssign(target=target, annotation=annotation, value=ast.expr() as value) if _is_int(annotation):
            return [f"{pad}{_expression(target)} = (int)({_expression(value)});"]
        case ast.AugAssign(target=target, op=op, value=value):
            return [f"{pad}{_expression(target)} {OPERATORS[type(op)]}= {_expression(value)};"]
        case ast.Return(value=value):
            return [f"{pad}return {_expression(value)};" if value is not None else f"{pad}return;"]
        case ast.Expr(value=ast.Call() as call):
            return [f"{pad}{_expression(call)};"]
        case ast.For(
            target=ast.Name(id=i), iter=ast.Call(func=ast.Name(id="range"), args=[stop]), body=body, orelse=[]
        ):
            lines = [f"{pad}for ({i} = 0; {i} < {_expression(stop)}; ++{i}) {{"]
            return [*lines, *(x for s in body for x in _statement(s, depth + 1)), f"{pad}}}"]
        case ast.If(test=test, body=body, orelse=orelse):
            lines = [f"{pad}if ({_expression(test)}) {{", *(x for s in body for x in _statement(s, depth + 1))]
            if orelse:
                lines += [f"{pad}}} else {{", *(x for s in orelse for x in _statement(s, depth + 1))]
            return [*lines, f"{pad}}}"]
    raise ValueError(f"no counterpart in C: {ast.unparse(node)}")


def _expression(node: ast.expr) -> str:  # noqa: PLR0911 - one case a kind of expression
    match node:
        case ast.Name(id=name):
            return name
        case ast.Constant(value=bool() as value):
            return str(int(value))
        case ast.Constant(value=int() | float() as value):
            return repr(value)
        case ast.Subscript(value=array, slice=index):
            return f"{_expression(array)}[{_expression(index)}]"
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            return f"({_expression(left)} {OPERATORS[type(op)]} {_expression(right)})"
        case ast.UnaryOp(op=op, operand=operand) if type(op) in OPERATORS:
            return f"({OPERATORS[type(op)]}{_expression(operand)})"
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in OPERATORS:
            return f"({_expression(left)} {OPERATORS[type(op)]} {_expression(right)})"
        case ast.BoolOp(op=op, values=values):
            return "(" + f" {OPERATORS[type(op)]} ".join(map(_expression, values)) + ")"
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return f"({_expression(test)} ? {_expression(body)} : {_expression(orelse)})"
        case ast.Call(func=function, args=arguments, keywords=[]):
            return f"{_callee(function)}({', '.join(map(_expression, arguments))})"
    raise ValueError(f"no counterpart in C: {ast.unparse(node)}")


def _callee(node: ast.expr) -> str:
    match node:
        case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in LIBRARY:
            return LIBRARY[name]
        case ast.Name(id=name):
            return BUILT_IN.get(name, name)
    raise ValueError(f"no counterpart in C: {ast.unparse(node)}")
