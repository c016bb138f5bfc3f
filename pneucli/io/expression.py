"""A signal computed from columns: arithmetic and a few functions, and nothing else, since a file's text is not run."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pneucli.io.raw_file import ColumnKey, ColumnValues

SUM = "cumsum"  # of a column, from the first row on: the clock of a column of time steps
ROW = "row"  # the number of the row, from 0, where no column is called so
FUNCTIONS: dict[str, Callable[[ColumnValues], ColumnValues]] = {
    **{"sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "tan": np.tan, "abs": np.abs, "exp": np.exp, "log": np.log},
    "floor": np.floor,
}
POWER = "pow"  # of two numbers, as formulas in files write it
_OPERATORS: dict[type[ast.AST], Callable[..., ColumnValues]] = {
    **{ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: np.divide, ast.Pow: np.power},
    **{ast.USub: operator.neg, ast.UAdd: operator.pos},
}
_CONSTANTS = {"pi": np.pi}
_QUOTED = re.compile(r"`([^`]*)`")
MAX_LENGTH = 500  # characters
MAX_DEPTH = 50  # operations within one another


@dataclass(frozen=True)
class Expression:
    """``text`` over columns: names as they are, or in backticks; a column's number in backticks too."""

    text: str
    _totals: dict[int, float] = field(default_factory=dict, compare=False, repr=False)

    @property
    def columns(self) -> tuple[ColumnKey, ...]:
        """The columns that are read, by name or number; ``row`` may be among them."""
        return tuple(dict.fromkeys(self._names().values()))

    def check(self) -> None:
        """Raise ValueError, found and wanted, where it is no arithmetic over columns."""
        if not self._names():
            raise ValueError(f'"{self.text}" reads no column; wanted arithmetic over columns')
        with np.errstate(all="ignore"):
            Expression(self.text)._value(self._tree(), dict.fromkeys(self._names(), np.ones(1)), 0)

    def values(self, columns: Mapping[ColumnKey, ColumnValues]) -> ColumnValues:
        """Return the value of every row, shape ``(n,)``; ``columns`` holds those of :attr:`columns`."""
        names = self._names()
        with np.errstate(all="ignore"):  # what becomes infinite is counted as such
            found = self._value(self._tree(), {name: columns[key] for name, key in names.items()}, 0)
        size = next(iter(columns.values())).size
        return np.asarray(np.broadcast_to(found, size), dtype=np.float64)

    def _names(self) -> dict[str, ColumnKey]:
        """Return columns by the names that stand for them in the tree."""
        quoted = dict.fromkeys(_QUOTED.findall(self.text))
        marks: dict[str, ColumnKey] = {_placeholder(n): int(q) if q.isdigit() else q for n, q in enumerate(quoted)}
        bare = (node.id for node in ast.walk(self._tree()) if isinstance(node, ast.Name))
        return {
            name: marks.get(name, name)
            for name in bare
            if name not in (*FUNCTIONS, SUM, POWER) and name not in _CONSTANTS
        }

    def _tree(self) -> ast.AST:
        quoted = list(dict.fromkeys(_QUOTED.findall(self.text)))
        plain = _QUOTED.sub(lambda match: f" {_placeholder(quoted.index(match[1]))} ", self.text).strip()
        wanted = "wanted arithmetic over columns, such as (`P1 [bar]` - `P2 [bar]`) / 2"
        if "?" in plain or len(self.text) > MAX_LENGTH:
            raise ValueError(f'"{self.text[:MAX_LENGTH]}" is to be filled in; {wanted}')
        try:
            return ast.parse(plain.replace("^", "**"), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise ValueError(f'"{self.text}" cannot be read; {wanted}') from error

    def _value(self, node: ast.AST, names: Mapping[str, ColumnValues], depth: int) -> ColumnValues:
        if depth > MAX_DEPTH:
            raise ValueError(
                f'"{self.text[:60]}..." goes too deep; wanted at most {MAX_DEPTH} operations in one another'
            )
        inner = [self._value(child, names, depth + 1) for child in _operands(node)]
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            return np.asarray(float(node.value))
        if isinstance(node, ast.Name) and (node.id in names or node.id in _CONSTANTS):
            return np.asarray(names[node.id] if node.id in names else _CONSTANTS[node.id])
        if isinstance(node, ast.BinOp | ast.UnaryOp) and type(node.op) in _OPERATORS:
            return _OPERATORS[type(node.op)](*inner)
        called = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
        if called in (*FUNCTIONS, SUM) and len(inner) == 1:
            return self._sum(inner[0], node) if called == SUM else FUNCTIONS[called](inner[0])
        if called == POWER and len(inner) == 2:
            return np.power(*inner)
        known = f"+ - * / ** and {', '.join((*FUNCTIONS, SUM))}"
        raise ValueError(f'"{ast.unparse(node)[:60]}" is no part of an expression; wanted columns, numbers, {known}')

    def _sum(self, values: ColumnValues, node: ast.AST) -> ColumnValues:
        """Return the sum of a column from its first row on; later batches go on from where the last one ended."""
        place = getattr(node, "col_offset", 0)
        sums = np.cumsum(np.nan_to_num(np.atleast_1d(values))) + self._totals.get(place, 0.0)
        self._totals[place] = float(sums[-1]) if sums.size else self._totals.get(place, 0.0)
        return np.asarray(sums)


def _operands(node: ast.AST) -> list[ast.AST]:
    if isinstance(node, ast.BinOp):
        return [node.left, node.right]
    if isinstance(node, ast.UnaryOp):
        return [node.operand]
    return list(node.args) if isinstance(node, ast.Call) and not node.keywords else []


def _placeholder(number: int) -> str:
    return f"_column_{number}_"
