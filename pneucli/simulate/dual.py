"""Dual numbers in compiled code: a value and its derivatives by some parameters, side by side in one vector.

The equations of the kernel contain no derivative. Compiled for dual numbers in place of floats, the same text gives
both: each operation below also applies the rule of differentiation that belongs to it. What an equation decides, it
decides by the value; at a kink the derivative is that of the side on which the value lies.

References:
    A. Griewank and A. Walther, Evaluating Derivatives, 2nd ed., SIAM (2008), chapter 3 (forward mode).
"""

import ast
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.extending import intrinsic, lower_builtin, lower_cast, models, register_model
from numba.core.imputils import impl_ret_borrowed
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

LANES = 8  # derivatives of a dual number: what one vector register of today's processors holds
ROW = LANES + 1  # floats of a dual number in memory: its value, then its derivatives

DOUBLE, INT = ir.DoubleType(), ir.IntType(64)
VECTOR = ir.VectorType(DOUBLE, LANES)
PAIR = ir.LiteralStructType([DOUBLE, VECTOR], packed=True)
ZEROS = ir.Constant(VECTOR, [0.0] * LANES)
RULES = ("contract", "nsz")  # of the arithmetic of derivatives: a product and a sum may be one rounding


class DualType(types.Type):
    """The type of a dual number."""

    def can_convert_from(self, typingctx: Any, other: types.Type) -> Conversion | None:
        """Return that a number is a dual number without derivatives."""
        return Conversion.safe if isinstance(other, types.Float | types.Integer) else None


dual = DualType("dual")


@register_model(DualType)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: types.Type) -> None:
        super().__init__(manager, kind, PAIR)


def _is_number(kind: types.Type) -> bool:
    return isinstance(kind, DualType | types.Float | types.Integer | types.IntegerLiteral)


def _mixed(kinds: Sequence[types.Type]) -> bool:
    return any(isinstance(kind, DualType) for kind in kinds) and all(map(_is_number, kinds))


def _pack(builder: ir.IRBuilder, value: Any, slope: Any) -> Any:
    out = builder.insert_value(ir.Constant(PAIR, ir.Undefined), value, 0)
    return builder.insert_value(out, ZEROS if slope is None else slope, 1)


def _unpack(context: Any, builder: ir.IRBuilder, number: Any, kind: types.Type) -> tuple[Any, Any]:
    """Return the value and the derivatives, None for a number without."""
    if isinstance(kind, DualType):
        return builder.extract_value(number, 0), builder.extract_value(number, 1)
    return context.cast(builder, number, kind, types.float64), None


def _spread(builder: ir.IRBuilder, value: Any) -> Any:
    """Return a vector with the value in each lane."""
    first = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    places = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, ir.Constant(VECTOR, ir.Undefined), places)


def _scaled(builder: ir.IRBuilder, slope: Any, factor: Any) -> Any:
    return None if slope is None else builder.fmul(slope, _spread(builder, factor), flags=RULES)


def _added(builder: ir.IRBuilder, a: Any, b: Any) -> Any:
    if a is None or b is None:
        return b if a is None else a
    return builder.fadd(a, b, flags=RULES)


def _less(builder: ir.IRBuilder, a: Any, b: Any) -> Any:
    if a is None or b is None:
        return a if b is None else builder.fneg(b)
    return builder.fsub(a, b, flags=RULES)


def _sum(b: ir.IRBuilder, x: tuple[Any, Any], y: tuple[Any, Any]) -> Any:
    return _pack(b, b.fadd(x[0], y[0]), _added(b, x[1], y[1]))


def _difference(b: ir.IRBuilder, x: tuple[Any, Any], y: tuple[Any, Any]) -> Any:
    return _pack(b, b.fsub(x[0], y[0]), _less(b, x[1], y[1]))


def _product(b: ir.IRBuilder, x: tuple[Any, Any], y: tuple[Any, Any]) -> Any:
    return _pack(b, b.fmul(x[0], y[0]), _added(b, _scaled(b, x[1], y[0]), _scaled(b, y[1], x[0])))


def _quotient(b: ir.IRBuilder, x: tuple[Any, Any], y: tuple[Any, Any]) -> Any:
    value, inverse = b.fdiv(x[0], y[0]), b.fdiv(ir.Constant(DOUBLE, 1.0), y[0])
    return _pack(b, value, _scaled(b, _less(b, x[1], _scaled(b, y[1], value)), inverse))


def _chosen(sign: str) -> Callable[..., Any]:
    def emit(b: ir.IRBuilder, x: tuple[Any, Any], y: tuple[Any, Any]) -> Any:
        first = b.fcmp_ordered(sign, x[0], y[0])
        slopes = (ZEROS if slope is None else slope for slope in (x[1], y[1]))
        return _pack(b, b.select(first, x[0], y[0]), b.select(first, *slopes))

    return emit


def _compared(sign: str) -> Callable[..., Any]:
    return lambda b, x, y: b.fcmp_ordered(sign, x[0], y[0])


def _register(function: Any, result: types.Type, emit: Callable[..., Any], arguments: int) -> None:
    """Make a function of numbers one of dual numbers, too: of ``arguments`` values with their derivatives."""

    class Rule(AbstractTemplate):
        key = function

        def generic(self, args: Sequence[types.Type], kws: Any) -> Any:
            return signature(result, *args) if len(args) == arguments and _mixed(args) and not kws else None

    infer_global(function)(Rule)

    def lower(context: Any, builder: ir.IRBuilder, sig: Any, args: Sequence[Any]) -> Any:
        return emit(builder, *(_unpack(context, builder, *pair) for pair in zip(args, sig.args, strict=True)))

    others = (types.Float, types.Integer, types.IntegerLiteral)
    if arguments == 1:
        lower_builtin(function, DualType)(lower)
        return
    lower_builtin(function, DualType, DualType)(lower)
    for other in others:
        lower_builtin(function, DualType, other)(lower)
        lower_builtin(function, other, DualType)(lower)


def _call(builder: ir.IRBuilder, name: str, value: Any) -> Any:
    kind = ir.FunctionType(DOUBLE, [DOUBLE])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.f64"), [value])


def _root(b: ir.IRBuilder, x: tuple[Any, Any]) -> Any:
    """Return the root; its derivative at 0, which is infinite, is taken for 0."""
    root = _call(b, "sqrt", x[0])
    positive = b.fcmp_ordered(">", root, ir.Constant(DOUBLE, 0.0))
    slope = b.select(positive, b.fdiv(ir.Constant(DOUBLE, 0.5), root), ir.Constant(DOUBLE, 0.0))
    return _pack(b, root, _scaled(b, x[1], slope))


def _exponential(b: ir.IRBuilder, x: tuple[Any, Any]) -> Any:
    value = _call(b, "exp", x[0])
    return _pack(b, value, _scaled(b, x[1], value))


def _logarithm(b: ir.IRBuilder, x: tuple[Any, Any]) -> Any:
    return _pack(b, _call(b, "log", x[0]), _scaled(b, x[1], b.fdiv(ir.Constant(DOUBLE, 1.0), x[0])))


def _sine(b: ir.IRBuilder, x: tuple[Any, Any]) -> Any:
    return _pack(b, _call(b, "sin", x[0]), _scaled(b, x[1], _call(b, "cos", x[0])))


def _cosine(b: ir.IRBuilder, x: tuple[Any, Any]) -> Any:
    return _pack(b, _call(b, "cos", x[0]), _scaled(b, x[1], b.fneg(_call(b, "sin", x[0]))))


def _power(b: ir.IRBuilder, x: tuple[Any, Any], y: tuple[Any, Any]) -> Any:
    """Return x to the power of y: its derivative by x is y x^(y - 1), that by y is x^y log x."""
    kind = ir.FunctionType(DOUBLE, [DOUBLE, DOUBLE])
    power = cgutils.get_or_insert_function(b.module, kind, "llvm.pow.f64")
    value, less = b.call(power, [x[0], y[0]]), b.fsub(y[0], ir.Constant(DOUBLE, 1.0))
    by_base = _scaled(b, x[1], b.fmul(y[0], b.call(power, [x[0], less])))
    by_exponent = _scaled(b, y[1], b.fmul(value, _call(b, "log", x[0]))) if y[1] is not None else None
    return _pack(b, value, _added(b, by_base, by_exponent))


def _absolute(b: ir.IRBuilder, x: tuple[Any, Any]) -> Any:
    negative = b.fcmp_ordered("<", x[0], ir.Constant(DOUBLE, 0.0))
    return _pack(b, _call(b, "fabs", x[0]), b.select(negative, b.fneg(x[1]), x[1]))


for _function, _emit in (
    (operator.add, _sum),
    (operator.sub, _difference),
    (operator.mul, _product),
    (operator.truediv, _quotient),
    (operator.iadd, _sum),
    (operator.isub, _difference),
    (operator.imul, _product),
    (operator.itruediv, _quotient),
    (operator.pow, _power),
    (math.pow, _power),
    (max, _chosen(">")),
    (min, _chosen("<")),
):
    _register(_function, dual, _emit, 2)
for _function, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
    (operator.ne, "!="),
):
    _register(_function, types.boolean, _compared(_sign), 2)
_register(operator.neg, dual, lambda b, x: _pack(b, b.fneg(x[0]), b.fneg(x[1])), 1)
_register(math.sqrt, dual, _root, 1)
_register(math.exp, dual, _exponential, 1)
_register(math.log, dual, _logarithm, 1)
_register(math.sin, dual, _sine, 1)
_register(math.cos, dual, _cosine, 1)
_register(abs, dual, _absolute, 1)
_register(math.floor, types.int64, lambda b, x: b.fptosi(_call(b, "floor", x[0]), INT), 1)


def is_known(tree: ast.AST) -> bool:
    """Return whether the equations of a syntax tree consist of what is differentiated here."""
    nodes = list(ast.walk(tree))
    called = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    named = {node.func.id for node in nodes if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    operators = {type(node.op) for node in nodes if isinstance(node, ast.BinOp | ast.AugAssign)}
    loops = any(isinstance(node, ast.For | ast.While) for node in nodes)
    return not loops and called <= _FUNCTIONS and not named & _ROUNDING and operators <= _OPERATORS


_FUNCTIONS = {"sqrt", "exp", "log", "sin", "cos", "pow", "floor", "pi", "e", "inf"}
_ROUNDING = {"float", "int", "round", "bool", "pow", "range"}
_OPERATORS = {ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow}


@lower_cast(types.Float, DualType)
@lower_cast(types.Integer, DualType)
def _constant(context: Any, builder: ir.IRBuilder, kind: types.Type, _: types.Type, value: Any) -> Any:
    return _pack(builder, context.cast(builder, value, kind, types.float64), None)


@intrinsic
def value_of(typingctx: Any, number: types.Type) -> Any:
    """Return a number without its derivatives."""

    def lower(context: Any, builder: ir.IRBuilder, sig: Any, args: Sequence[Any]) -> Any:
        return _unpack(context, builder, args[0], sig.args[0])[0]

    return types.float64(number), lower


@intrinsic
def as_duals(typingctx: Any, rows: types.Array) -> Any:
    """Return an array of floats (..., ROW) as one of dual numbers (...), in the same memory."""
    out = types.Array(dual, rows.ndim - 1, "C")

    def lower(context: Any, builder: ir.IRBuilder, sig: Any, args: Sequence[Any]) -> Any:
        from numba.np.arrayobj import populate_array  # noqa: PLC0415 - slow to import, and only a compilation needs it

        given = context.make_array(sig.args[0])(context, builder, args[0])
        made = context.make_array(out)(context, builder)
        populate_array(
            made,
            data=builder.bitcast(given.data, context.get_data_type(dual).as_pointer()),
            shape=cgutils.unpack_tuple(builder, given.shape)[:-1],
            strides=cgutils.unpack_tuple(builder, given.strides)[:-1],
            itemsize=context.get_constant(types.intp, 8 * ROW),
            meminfo=given.meminfo,
            parent=given.parent,
        )
        return impl_ret_borrowed(context, builder, out, made._getvalue())

    return out(rows), lower


@intrinsic
def slopes_between(typingctx: Any, table: types.Array, row: types.Type, share: types.Type, places: types.Array) -> Any:
    """Return a dual number of value 0 whose derivatives lie between two rows of a table.

    It has the derivatives in the columns ``places`` (LANES,) of a table (rows, columns), at the ``share`` of the way
    from a row to the next.
    """

    def lower(context: Any, builder: ir.IRBuilder, sig: Any, args: Sequence[Any]) -> Any:
        given, where = (context.make_array(sig.args[i])(context, builder, args[i]) for i in (0, 3))
        columns = cgutils.unpack_tuple(builder, given.shape)[1]
        below = builder.mul(context.cast(builder, args[1], sig.args[1], types.intp), columns)
        vectors = []
        for first in (below, builder.add(below, columns)):
            vector = ir.Constant(VECTOR, ir.Undefined)
            for lane in range(LANES):
                place = builder.load(builder.gep(where.data, [context.get_constant(types.intp, lane)]))
                number = builder.load(builder.gep(given.data, [builder.add(first, place)]))
                vector = builder.insert_element(vector, number, ir.Constant(ir.IntType(32), lane))
            vectors.append(vector)
        way = _scaled(builder, _less(builder, vectors[1], vectors[0]), args[2])
        return _pack(builder, ir.Constant(DOUBLE, 0.0), _added(builder, vectors[0], way))

    return dual(table, row, types.float64, places), lower
