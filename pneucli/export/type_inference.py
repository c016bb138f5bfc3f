"""What kind of number each name of the restricted Python holds: whole, true or false, else real."""

import ast
import inspect
import textwrap
from collections.abc import Callable
from typing import Any, Literal

NumberType = Literal["whole", "truth", "real", "nothing"]
INTEGER_FUNCTIONS = ("int",)
INDEX_PREFIXES = ("C_", "S_", "L_")  # places in the arrays begin so
COMMON_OPERATORS: dict[type[ast.AST], str] = {  # operators that C and structured text write the same
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
}


def syntax_tree(function: Callable[..., Any]) -> ast.FunctionDef:
    """Return the syntax tree of a function."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    return tree


def summary(tree: ast.FunctionDef) -> str:
    """Return the first paragraph of a function's docstring."""
    return (ast.get_docstring(tree) or "").partition("\n\n")[0]


class InferredTypes:
    """The kinds of a function's arguments and locals, of what it returns, and of any expression in it.

    ``truths`` names the functions that return true or false.
    """

    def __init__(self, tree: ast.FunctionDef, truths: frozenset[str] = frozenset()) -> None:
        self._truths = truths
        self.whole: list[str] = [a.arg for a in tree.args.args if _is_int(a.annotation)]
        self.truth: list[str] = []
        self.real: list[str] = []
        self.arguments = [a.arg for a in tree.args.args]
        for node in ast.walk(tree):
            match node:
                case ast.AnnAssign(target=ast.Name(id=name), annotation=kind) if _is_int(kind):
                    self.whole.append(name)
                case ast.For(target=ast.Name(id=name)):
                    self.whole.append(name)
        self._find_truths(tree)
        for node in ast.walk(tree):
            match node:
                case ast.Assign(targets=[ast.Name(id=name), *_]) if name not in [*self.whole, *self.truth]:
                    self.real.append(name)
        self.returns = self._returned(tree)

    def _find_truths(self, tree: ast.FunctionDef) -> None:
        """What is asked whether it is true, or is set from a comparison, is true or false."""
        for node in ast.walk(tree):
            tests = [node.test] if isinstance(node, ast.If | ast.IfExp) else []
            tests += node.values if isinstance(node, ast.BoolOp) else []
            tests += [node.operand] if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not) else []
            self.truth += [t.id for t in tests if isinstance(t, ast.Name)]
            match node:
                case ast.Assign(targets=[ast.Name(id=name)], value=value) if self.of(value) == "truth":
                    self.truth.append(name)

    def _returned(self, tree: ast.FunctionDef) -> NumberType:
        values = [n.value for n in ast.walk(tree) if isinstance(n, ast.Return) and n.value is not None]
        if not values:
            return "nothing"
        return "truth" if all(self.of(value) == "truth" for value in values) else "real"

    def of(self, node: ast.expr) -> NumberType:  # noqa: PLR0911 - one case a kind of expression
        """Return the kind of an expression."""
        match node:
            case ast.Constant(value=bool()) | ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
                return "truth"
            case ast.Constant(value=int()):
                return "whole"
            case ast.Name(id=name):
                if name in self.truth:
                    return "truth"
                return "whole" if name in self.whole or name.startswith(INDEX_PREFIXES) else "real"
            case ast.BinOp(left=left, right=right, op=op) if not isinstance(op, ast.Div):
                return "whole" if self.of(left) == self.of(right) == "whole" else "real"
            case ast.UnaryOp(operand=operand):
                return self.of(operand)
            case ast.IfExp(body=body, orelse=orelse):
                return self.of(body) if self.of(body) == self.of(orelse) else "real"
            case ast.Call(func=ast.Name(id=name), args=arguments):
                if name in self._truths:
                    return "truth"
                whole = name in INTEGER_FUNCTIONS or (
                    name in ("min", "max") and all(self.of(a) == "whole" for a in arguments)
                )
                return "whole" if whole else "real"
            case ast.Call(func=ast.Attribute(attr="isfinite")):
                return "truth"
        return "real"

    def locals(self, names: list[str]) -> list[str]:
        """Return names that are no arguments, each once."""
        return [name for name in dict.fromkeys(names) if name not in self.arguments]


def _is_int(annotation: ast.expr | None) -> bool:
    return isinstance(annotation, ast.Name) and annotation.id == "int"
