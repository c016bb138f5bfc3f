"""A control law: its sample in scalar code, its own states and parameters, and the functions that it needs."""

from __future__ import annotations

import ast
import inspect
import sys
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import FunctionType
from typing import Any

from pneucli.controller import layout


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


@dataclass(frozen=True)
class ControlLaw:
    """One control law: ``step(x_ref, x, p1, p2, s, c)`` is its sample, in the scalar code of ``pneucli.controller.cascade``.

    ``source`` names its equations in the thesis. ``design`` returns from a plan all its own numbers, a table last, and
    those of the common ones that it changes; it raises InputError where the plan lacks what it needs. ``estimates_load``:
    whether it has an estimate of the load; ``controls_pressure``: whether it has a pressure loop that takes a reference.
    """

    name: str
    title: str
    source: str
    step: Callable[..., None]
    estimates_load: bool = False
    controls_pressure: bool = True

    @cached_property
    def constants(self) -> dict[str, int]:
        """Places of its own states and numbers, those of the parts that it uses included."""
        modules = {sys.modules[f.__module__] for f in callees_first(self.step)}
        return {name: place for module in modules for name, place in own_constants(vars(module)).items()}

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its own numbers, in the order in which they stand behind the inverse tables."""
        return self._named("C_")

    @property
    def states(self) -> tuple[str, ...]:
        """Names of its own states, which stand behind the common ones."""
        return self._named("S_")

    def _named(self, begin: str) -> tuple[str, ...]:
        return tuple(sorted((n for n in self.constants if n.startswith(begin)), key=self.constants.__getitem__))


def own_constants(names: Mapping[str, Any]) -> dict[str, int]:
    """Return the constants of states and numbers among a module's names that are not those of the layout."""
    common = vars(layout)
    return {n: v for n, v in names.items() if n.startswith(("S_", "C_")) and n not in common}
