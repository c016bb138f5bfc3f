"""Which of the program's functions a scalar function needs, so that it can be written down whole."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable
from types import FunctionType
from typing import Any


def callees_first(root: Callable[..., Any]) -> list[FunctionType]:
    """Return the program's functions that ``root`` needs, and ``root``, each after those that it calls."""
    done: dict[str, FunctionType] = {}

    def visit(function: Any) -> None:
        for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function)))):
            name = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
            called = function.__globals__.get(name)
            if isinstance(called, FunctionType) and name not in done and called is not function:
                visit(called)
        done[function.__name__] = function

    visit(root)
    return list(done.values())
