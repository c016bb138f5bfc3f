"""Rewrite the functions of the kernel into the restricted Python that :mod:`pneucli.export.c_translator` writes as C.

C has no tuples: a function that returns one takes an array ``result`` instead, and its caller reads that array.
Assignments to several targets become single ones, ``x in (a, b)`` comparisons, ``a ** b`` a call of ``pow``. Integers
are annotated, sizes of arrays are constants, and names that C reserves get an underscore.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from pneucli.export.fmu.lowered_expressions import Expressions, Shapes

RESULT = "result"


@dataclass
class Lowered:
    """A function that C can express, and its local arrays by their length."""

    tree: ast.FunctionDef
    arrays: dict[str, int] = field(default_factory=dict)


def tuple_lengths(functions: Mapping[str, ast.FunctionDef]) -> dict[str, int]:
    """Return the length of the tuple that each function returns; functions that return none are left out."""
    found: dict[str, int] = {}
    for _ in functions:  # a function may return what another one returns
        before = dict(found)
        for name, tree in functions.items():
            for node in ast.walk(tree):
                match node:
                    case ast.Return(value=ast.Tuple(elts=elements)):
                        found[name] = len(elements)
                    case ast.Return(value=ast.Call(func=ast.Name(id=called))) if called in found:
                        found[name] = found[called]
        if found == before:
            break
    return found


def lower(tree: ast.FunctionDef, shapes: Shapes) -> Lowered:
    """Return a function as restricted Python.

    Args:
        tree: The function.
        shapes: What is known of the program.

    Returns:
        The function with its local arrays.

    Raises:
        ValueError: It has Python without a counterpart in C.
    """
    own = {a.arg for a in tree.args.args} | {
        n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    }
    expressions = Expressions(shapes, own, _whole_names(tree))
    lowered = Lowered(ast.FunctionDef(tree.name, tree.args, [], [], None))
    statements = _Statements(shapes, expressions, lowered.arrays)
    for argument in tree.args.args:
        argument.arg = expressions.renamed(argument.arg)
    if tree.name in shapes.tuples:
        tree.args.args.append(ast.arg(RESULT))
    lowered.tree.body = [line for one in tree.body for line in statements.of(one)]
    ast.fix_missing_locations(lowered.tree)
    return lowered


def _whole_names(tree: ast.FunctionDef) -> set[str]:
    """Return the names that hold integers: annotated ones, and those that ``int(...)`` is assigned to."""
    found = {a.arg for a in tree.args.args if isinstance(a.annotation, ast.Name) and a.annotation.id == "int"}
    for node in ast.walk(tree):
        match node:
            case ast.AnnAssign(target=ast.Name(id=name), annotation=ast.Name(id="int")):
                found.add(name)
            case ast.For(target=ast.Name(id=name)):
                found.add(name)
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Call(func=ast.Name(id="int"))):
                found.add(name)
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Tuple(elts=values)):
                pairs = zip(targets, values, strict=True)
                found |= {t.id for t, v in pairs if isinstance(t, ast.Name) and _is_call_of(v, "int")}
    return found


def _is_call_of(node: ast.expr, name: str) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == name


class _Statements:
    """Rewrites statements; adds the arrays that they need to ``arrays``."""

    def __init__(self, shapes: Shapes, expressions: Expressions, arrays: dict[str, int]) -> None:
        self.shapes, self.expressions, self.arrays = shapes, expressions, arrays
        self.value: Callable[[ast.expr], ast.expr] = expressions.visit

    def of(self, node: ast.stmt) -> list[ast.stmt]:  # noqa: PLR0911 - one case a kind of statement
        """Return the statements that replace one."""
        match node:
            case ast.Return(value=ast.expr() as value):
                return list(self._returned(value))
            case ast.AnnAssign(target=ast.Name() as target, value=ast.expr() as value):
                return [self._assigned(target, self.value(value))]
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Tuple(elts=values)):
                return list(self._several(targets, values))
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Call() as call):
                return list(self._from_call(targets, call))
            case ast.Assign(targets=[first, *others], value=value) if not isinstance(first, ast.Tuple):
                again = [self._assigned(one, self.value(_as_read(first))) for one in others]
                return [self._assigned(first, self.value(value)), *again]
            case ast.AugAssign(target=target, op=op, value=value):
                return [self._assigned(target, self.value(ast.BinOp(_as_read(target), op, value)))]
            case ast.If() | ast.While() | ast.For():
                return [self._block(node)]
        return [node] if not isinstance(node, ast.Expr) else [ast.Expr(self.value(node.value))]

    def _block(self, node: ast.If | ast.While | ast.For) -> ast.stmt:
        for name in ("body", "orelse"):
            setattr(node, name, [line for one in getattr(node, name) for line in self.of(one)])
        if isinstance(node, ast.For):
            node.target, node.iter = self.value(node.target), self.value(node.iter)
        else:
            node.test = self.value(node.test)
        return node

    def _assigned(self, target: ast.expr, value: ast.expr) -> ast.stmt:
        """Return the assignment of a lowered value to a target; an integer is annotated."""
        if isinstance(target, ast.Name) and target.id in self.expressions.whole:
            if isinstance(value, ast.Call) and _is_call_of(value, "int"):
                value = value.args[0]  # an annotated integer is converted anyway
            return ast.AnnAssign(ast.Name(self.expressions.renamed(target.id)), ast.Name("int"), value, 1)
        return ast.Assign([self.value(target)], value)

    def _several(self, targets: Sequence[ast.expr], values: Sequence[ast.expr]) -> Iterator[ast.stmt]:
        """Yield the assignments of a tuple; what a later value still reads is written last."""
        late: list[tuple[ast.expr, ast.expr]] = []
        for i, (target, value) in enumerate(zip(targets, values, strict=True)):
            if any(_root(target) in _names(later) for later in values[i + 1 :]):
                kept = self._array(1)
                yield ast.Assign([kept], self.value(value))
                late.append((target, _as_read(kept)))
            else:
                yield self._assigned(target, self.value(value))
        yield from (self._assigned(target, value) for target, value in late)

    def _from_call(self, targets: Sequence[ast.expr], call: ast.Call) -> Iterator[ast.stmt]:
        """Yield the call of a function that returns a tuple, and the assignments of what it returns."""
        if not isinstance(call.func, ast.Name) or self.shapes.tuples.get(call.func.id) != len(targets):
            raise ValueError(f"no counterpart in C: {ast.unparse(call)}")
        array = self._array(len(targets)).value
        assert isinstance(array, ast.Name)
        yield ast.Expr(ast.Call(call.func, [*map(self.value, call.args), ast.Name(array.id)], []))
        for i, target in enumerate(targets):
            if not (isinstance(target, ast.Name) and target.id == "_"):
                yield self._assigned(target, ast.Subscript(ast.Name(array.id), ast.Constant(i)))

    def _returned(self, value: ast.expr) -> Iterator[ast.stmt]:
        match value:
            case ast.Tuple(elts=values):
                for i, one in enumerate(values):
                    yield ast.Assign([ast.Subscript(ast.Name(RESULT), ast.Constant(i))], self.value(one))
                yield ast.Return(None)
            case ast.Call(func=ast.Name(id=name) as function, args=arguments) if name in self.shapes.tuples:
                yield ast.Expr(ast.Call(function, [*map(self.value, arguments), ast.Name(RESULT)], []))
                yield ast.Return(None)
            case _:
                yield ast.Return(self.value(value))

    def _array(self, length: int) -> ast.Subscript:
        """Return the first place of a new local array."""
        name = f"tuple_{len(self.arrays) + 1}"
        self.arrays[name] = length
        return ast.Subscript(ast.Name(name), ast.Constant(0))


def _as_read(target: ast.expr) -> ast.expr:
    """Return a target as an expression that reads it."""
    return ast.parse(ast.unparse(target), mode="eval").body


def _root(target: ast.expr) -> str:
    owner = target.value if isinstance(target, ast.Subscript) else target
    return owner.id if isinstance(owner, ast.Name) else ""


def _names(node: ast.expr) -> set[str]:
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
