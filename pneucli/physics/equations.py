"""Read a port's function as the kernel compiles it: its text, with helpers and constants of its file, renamed.

The kernel compiles plain arithmetic only. Checks here find what it cannot compile before anything runs: undefined
names, arguments that do not match the port, strings, lists, attributes of objects.
"""

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Iterator
from types import FunctionType
from typing import Any

from pneucli.physics import gas
from pneucli.physics.declaration import Effect
from pneucli.physics.ports import PORTS

ALLOWED_BUILTINS = {"min", "max", "abs", "float", "int", "round", "range", "bool", "pow", "True", "False"}
_ALLOWED_NODES = (
    *(ast.FunctionDef, ast.arguments, ast.arg, ast.Return, ast.Assign, ast.AugAssign, ast.AnnAssign, ast.Pass),
    *(ast.If, ast.For, ast.While, ast.Break, ast.Continue, ast.IfExp, ast.Expr, ast.Constant, ast.Name, ast.Call),
    *(ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.Tuple, ast.Attribute),
    *(ast.operator, ast.unaryop, ast.boolop, ast.cmpop, ast.expr_context),
)


class EquationError(ValueError):
    """A function has something that the kernel cannot compile.

    Attributes:
        found: What the function has.
        wanted: What the kernel compiles instead.
    """

    def __init__(self, found: str, wanted: str) -> None:
        super().__init__(found)
        self.found, self.wanted = found, wanted


def effect_source(effect: Effect, prefix: str) -> str:
    """Return the text of an effect's port functions, helpers first.

    Args:
        effect: The effect.
        prefix: Prefix of the names, which makes them unique in the kernel.

    Returns:
        Python text; each function is named ``prefix__NAME``, constants of its file are replaced by their values, and
        docstrings and annotations are removed.

    Raises:
        EquationError: A function has no text of its own, is not plain, or has more than arithmetic, `if` and `for`.

    >>> from pneucli.physics.effects import catalogue
    >>> print(effect_source(catalogue()["acceleration-bias"], "a"))
    def a__read_a(a, bias):
        return a + bias
    """
    functions = {f.__name__: f for port in effect.ports.values() for f in _with_helpers(_require_plain_function(port))}
    names = {name: f"{prefix}__{name}" for name in functions}
    return "\n\n".join(ast.unparse(_Renamer(f, names).visit(_function_tree(f))) for f in functions.values())


def check_effect(effect: Effect) -> None:
    """Check that the kernel can compile every function of an effect.

    Args:
        effect: The effect.

    Returns:
        Nothing; the check passed.

    Raises:
        EquationError: A function cannot be compiled, takes other arguments than its port, or returns no number; the
            message names the port.

    >>> from pneucli.physics.effects import catalogue
    >>> check_effect(catalogue()["stribeck"])
    """
    for name, function in effect.ports.items():
        needed = PORTS[name].before
        if needed is not None and needed not in effect.ports:
            raise EquationError(
                f'port {name}: it acts nowhere without the port "{needed}"', f'a function at "{needed}"'
            )
        try:
            _check_arguments(_require_plain_function(function), name, effect)
            for one in _with_helpers(_require_plain_function(function)):
                _check_names(one)
            _check_return_value(_require_plain_function(function), name)
        except EquationError as fault:
            raise EquationError(f"port {name}: {fault.found}", fault.wanted) from fault


def _function_tree(function: FunctionType) -> ast.FunctionDef:
    """Parse the text of a function.

    >>> from pneucli.physics.gas import choked_ratio
    >>> [argument.arg for argument in _function_tree(choked_ratio).args.args]
    ['kappa']
    """
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    except (OSError, SyntaxError, IndexError) as error:
        raise EquationError(f"{function.__name__} has no text of its own", "def NAME(...): ...") from error
    if not isinstance(tree, ast.FunctionDef) or tree.decorator_list:
        raise EquationError(f"{function.__name__} is no plain function", "def NAME(...): ..., without decorators")
    if ast.get_docstring(tree) is not None:
        tree.body = tree.body[1:] or [ast.Pass()]
    for inner in ast.walk(tree):
        if isinstance(inner, ast.arg):
            inner.annotation = None
    tree.returns = None
    for inner in ast.walk(tree):
        if not isinstance(inner, _ALLOWED_NODES) or (isinstance(inner, ast.Constant) and isinstance(inner.value, str)):
            kind = type(inner).__name__.lower()
            line = getattr(inner, "lineno", 1)
            raise EquationError(
                f"{function.__name__}, line {line} of it, has a {kind}", "arithmetic, if, for over a range"
            )
    return tree


def _require_plain_function(function: Callable[..., object]) -> FunctionType:
    if not isinstance(function, FunctionType) or function.__name__ == "<lambda>":
        raise EquationError(f"{function!r:.60} is no plain function", "def NAME(...): ...")
    return function


def _with_helpers(function: FunctionType) -> list[FunctionType]:
    """Return a function and the functions of its file that it calls, called functions first."""
    found: dict[str, FunctionType] = {}
    waiting: list[str] = []

    def take(one: FunctionType) -> None:
        if one.__name__ in waiting:
            raise EquationError(f"{one.__name__} calls itself", "helpers that do not")
        waiting.append(one.__name__)
        for name in _global_names(one):
            inner = one.__globals__.get(name)
            if isinstance(inner, FunctionType) and inner.__module__ == function.__module__:
                take(inner)
        waiting.pop()
        found[one.__name__] = one

    take(function)
    return list(found.values())


def _global_names(function: FunctionType) -> Iterator[str]:
    """Yield the names that a function takes from outside, each once."""
    tree = _function_tree(function)
    own = {a.arg for a in tree.args.args} | {
        inner.id for inner in ast.walk(tree) if isinstance(inner, ast.Name) and isinstance(inner.ctx, ast.Store)
    }
    used = [inner.id for inner in ast.walk(tree) if isinstance(inner, ast.Name) and inner.id not in own]
    return iter(dict.fromkeys(used))


def _check_arguments(function: FunctionType, port: str, effect: Effect) -> None:
    wanted = [*PORTS[port].arguments, *(p.name for p in effect.parameters)]
    given = list(inspect.signature(function).parameters.values())
    if len(given) != len(wanted) or any(p.kind is not p.POSITIONAL_OR_KEYWORD for p in given):
        names = ", ".join(p.name for p in given)
        raise EquationError(
            f"{function.__name__}({names}) takes {len(given)} arguments, not {len(wanted)}",
            f"{function.__name__}({', '.join(wanted)}): those of the port, then the effect's parameters",
        )


def _check_names(function: FunctionType) -> None:
    for name in _global_names(function):
        if name not in ALLOWED_BUILTINS and not _is_supported(function.__globals__.get(name), function.__module__):
            wanted = "a number, a function of the same file, math, or one of pneucli.physics.gas"
            raise EquationError(f'{function.__name__} uses "{name}", which the simulator does not know', wanted)
    for inner in ast.walk(_function_tree(function)):
        if isinstance(inner, ast.Attribute):
            owner = function.__globals__.get(inner.value.id) if isinstance(inner.value, ast.Name) else None
            if owner is not math or not hasattr(math, inner.attr):
                raise EquationError(
                    f'{function.__name__} uses "{ast.unparse(inner)}"', "math.NAME, and nothing else with a dot"
                )


def _is_supported(value: Any, file: str) -> bool:
    if isinstance(value, FunctionType):
        return getattr(gas, value.__name__, None) is value or value.__module__ == file
    return value is math or (_is_number(value) and math.isfinite(value))


def _check_return_value(function: FunctionType, port: str) -> None:
    """Call a function once in plain Python; require a number, of a state the value and the new state."""
    try:
        answer = function(*[1.0] * function.__code__.co_argcount)
    except (ArithmeticError, ValueError):
        return  # it may return a number at other values
    except Exception as error:
        raise EquationError(f"{function.__name__} fails: {error}", "a function of numbers") from error
    if PORTS[port].combine == "state":
        if not isinstance(answer, tuple) or len(answer) != 2 or not all(_is_number(one) for one in answer):
            raise EquationError(f"{function.__name__} gives {answer!r:.40}", "two numbers: the value and the new state")
    elif not _is_number(answer):
        raise EquationError(f"{function.__name__} gives {answer!r:.40}", "a number")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float)


class _Renamer(ast.NodeTransformer):
    """Replace in a function's tree its own name, the names of its file's functions, and constants by values."""

    def __init__(self, function: FunctionType, names: dict[str, str]) -> None:
        self.names, self.outside = names, set(_global_names(function))
        self.values = function.__globals__

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """Rename the function itself."""
        node.name = self.names.get(node.name, node.name)
        return self.generic_visit(node)

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """Rename a helper, or replace a constant of the file by its value."""
        if node.id not in self.outside:
            return node
        value = self.values.get(node.id)
        if isinstance(value, int | float) and not isinstance(value, bool):
            return ast.copy_location(ast.Constant(value), node)
        own = isinstance(value, FunctionType) and getattr(gas, node.id, None) is not value
        return ast.Name(self.names.get(node.id, node.id), node.ctx) if own else node
