"""Rewrite expressions of the kernel into those that :mod:`pneucli.export.c_translator` writes as C."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass

RESERVED = frozenset(
    (
        *("auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern"),
        *("float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return", "short", "signed"),
        *("sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while"),
    )
)  # the keywords of C99


@dataclass(frozen=True)
class Shapes:
    """What the lowering knows of the whole program.

    Attributes:
        tuples: Length of the tuple that a function returns, by function.
        sizes: Lengths of the axes of an array, by its name.
        constants: How a constant is named in C, by its name in Python.
    """

    tuples: Mapping[str, int]
    sizes: Mapping[str, tuple[int, ...]]
    constants: Mapping[str, str]


class Expressions(ast.NodeTransformer):
    """Rewrites expressions; ``own`` are the names of the function, ``whole`` those of them that hold integers."""

    def __init__(self, shapes: Shapes, own: set[str], whole: set[str]) -> None:
        self.shapes, self.own, self.whole = shapes, own, whole

    def renamed(self, name: str) -> str:
        """Return a name of the function as C takes it."""
        return f"{name}_" if name in RESERVED else name

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Rename a constant, or a name that C reserves."""
        if node.id in self.own:
            return ast.Name(self.renamed(node.id), node.ctx)
        return ast.Name(self.shapes.constants.get(node.id, node.id), node.ctx)

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Replace constants of ``math`` and sizes of arrays by numbers."""
        match node:
            case ast.Attribute(value=ast.Name(id="math"), attr=name):
                value = getattr(math, name)
                if callable(value):
                    return node
                return (
                    ast.Constant(value) if math.isfinite(value) else ast.Name(name.upper().replace("INF", "INFINITY"))
                )
            case ast.Attribute(value=ast.Name(id=array), attr="size") if array in self.shapes.sizes:
                return ast.Constant(self.shapes.sizes[array][0])
        raise ValueError(f"no counterpart in C: {ast.unparse(node)}")

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        """Replace two indices by one, and the shape of an array by a number."""
        match node:
            case ast.Subscript(
                value=ast.Attribute(value=ast.Name(id=array), attr="shape"), slice=ast.Constant(value=int() as i)
            ):
                return ast.Constant(self.shapes.sizes[array][i])
            case ast.Subscript(value=ast.Name(id=array), slice=ast.Tuple(elts=[row, column])):
                place = ast.BinOp(row, ast.Mult(), ast.Constant(self.shapes.sizes[array][1]))
                return ast.Subscript(
                    self.visit(node.value), ast.BinOp(self.visit(place), ast.Add(), self.visit(column)), node.ctx
                )
        return self.generic_visit(node)  # type: ignore[return-value]

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """Replace powers by calls, and divide real numbers only."""
        match node:
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                power = ast.Attribute(ast.Name("math"), "pow")
                return ast.Call(power, [self.real(left), self.real(right)], [])
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                return ast.BinOp(self.real(left), ast.Div(), self.real(right))
        return self.generic_visit(node)  # type: ignore[return-value]

    def real(self, node: ast.expr) -> ast.expr:
        """Return a lowered operand as a real number: C divides integers as integers."""
        match node:
            case ast.Constant(value=int() as value):
                return ast.Constant(float(value))
            case ast.Name(id=name) if name in self.whole:
                return ast.Call(ast.Name("float"), [self.visit(node)], [])
        lowered = self.visit(node)
        assert isinstance(lowered, ast.expr)
        return lowered

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        """Replace ``in`` a tuple and chains by pairs of comparisons."""
        match node:
            case ast.Compare(left=left, ops=[ast.In() | ast.NotIn() as op], comparators=[ast.Tuple(elts=values)]):
                one, all_ = (ast.Eq(), ast.Or()) if isinstance(op, ast.In) else (ast.NotEq(), ast.And())
                return ast.BoolOp(all_, [ast.Compare(self.visit(left), [one], [self.visit(v)]) for v in values])
        sides = [self.visit(side) for side in (node.left, *node.comparators)]
        pairs = [ast.Compare(sides[i], [op], [sides[i + 1]]) for i, op in enumerate(node.ops)]
        return pairs[0] if len(pairs) == 1 else ast.BoolOp(ast.And(), pairs)  # type: ignore[arg-type]

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """Replace calls that C names otherwise."""
        arguments = [self.visit(argument) for argument in node.args]
        match node.func:
            case ast.Name(id="abs"):
                return ast.Call(ast.Attribute(ast.Name("math"), "fabs"), arguments, [])
            case ast.Name(id="pow"):
                return ast.Call(ast.Attribute(ast.Name("math"), "pow"), arguments, [])
            case ast.Name(id="min" | "max" as name) if len(arguments) > 2:
                first = ast.Call(ast.Name(name), arguments[:2], [])
                return self.visit_Call(ast.Call(ast.Name(name), [first, *arguments[2:]], []))
            case ast.Name(id=name) if name in self.shapes.tuples:
                raise ValueError(f"no counterpart in C: {ast.unparse(node)} within an expression")
        return ast.Call(self.visit(node.func), arguments, node.keywords)
