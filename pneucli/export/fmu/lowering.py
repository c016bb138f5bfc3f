"""Rewrite the functions of the kernel into the restricted Python that :mod:`pneucli.export.c_source` writes as C.

C has no tuples: a function that returns one takes an array ``result`` instead, and its caller reads that array.
Assignments to several targets become single ones, ``x in (a, b)`` comparisons, ``a ** b`` a call of ``pow``. Integers
are annotated, sizes of arrays are constants, and names that C reserves get an underscore.
"""

import ast
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

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
