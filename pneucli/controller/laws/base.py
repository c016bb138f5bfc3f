"""A control law: its sample in scalar code, its own states and parameters, and the functions that it needs."""

from __future__ import annotations

import ast
import inspect
import sys
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from types import FunctionType
from typing import Any

from pneucli.controller import layout


def callees_first(root: Callable[..., Any]) -> list[FunctionType]:
    """Return ``root`` and the functions that it calls, directly or not, each after its callees."""
    done: dict[str, FunctionType] = {}

    def visit(function: Any) -> None:
        for name in _called_names(function):
            called = function.__globals__.get(name)
            if isinstance(called, FunctionType) and name not in done and called is not function:
                visit(called)
        done[function.__name__] = function

    visit(root)
    return list(done.values())


@cache
def _called_names(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the names that a function's text calls, in the order of the text; an export asks for them many times."""
    nodes = ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function))))
    return tuple(node.func.id for node in nodes if isinstance(node, ast.Call) and isinstance(node.func, ast.Name))


@dataclass(frozen=True)
class ControlLaw:
    """One control law.

    Attributes:
        name: Key of ``[design] controller``.
        title: Description for users.
        source: Equations of the thesis.
        step: Sample of the law, ``step(x_ref, x, p1, p2, s, c)``, in the scalar code of
            :mod:`pneucli.controller.cascade`.
        estimates_load: Whether S_LOAD is an estimate of the load.
        controls_pressure: Whether the law can follow a reference of pressure.

    """

    name: str
    title: str
    source: str
    step: Callable[..., None]
    estimates_load: bool = False
    controls_pressure: bool = True

    @cached_property
    def constants(self) -> dict[str, int]:
        """Indices of the law's own states and parameters by name, those of shared blocks included."""
        modules = {sys.modules[f.__module__] for f in callees_first(self.step)}
        return {name: place for module in modules for name, place in own_constants(vars(module)).items()}

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the law's own parameters, in the order in which they follow the tables."""
        return self._named("C_")

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the law's own states, in the order in which they follow the common ones."""
        return self._named("S_")

    def _named(self, begin: str) -> tuple[str, ...]:
        return tuple(sorted((n for n in self.constants if n.startswith(begin)), key=self.constants.__getitem__))


def own_constants(names: Mapping[str, Any]) -> dict[str, int]:
    """Return the constants S_ and C_ among a module's names that the layout does not define."""
    common = vars(layout)
    return {n: v for n, v in names.items() if n.startswith(("S_", "C_")) and n not in common}
