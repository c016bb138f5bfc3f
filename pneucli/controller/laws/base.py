"""A control law: its sample in scalar code, its synthesis, its own states and parameters, the functions it needs."""

import ast
import inspect
import sys
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
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


LawParameters = Mapping[str, "float | tuple[float, ...]"]


@dataclass(frozen=True)
class ControlLaw:
    """One control law.

    A file of this folder declares it, or a package of somebody else, as an entry point of the group ``pneucli.laws``.

    Attributes:
        name: Key of ``[design] controller``.
        title: Description for users.
        source: Equations of the thesis.
        step: Sample of the law, ``step(x_ref, x, p1, p2, s, c)``, in the scalar code of
            :mod:`pneucli.controller.cascade`.
        design: The law's own parameters by name, and common ones that it changes, from the data of an axis, a
            :class:`pneucli.design.control_laws.DesignData`.
        place: Where it stands among all laws; those of other packages come last.
        variants: Choices of the law by the keys of ``[design]``, by their titles.
        estimates_load: Whether S_LOAD is an estimate of the load.
        controls_pressure: Whether the law can follow a reference of pressure.

    """

    name: str
    title: str
    source: str
    step: Callable[..., None]
    design: Callable[[Any], LawParameters]
    place: int = 1000
    variants: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    estimates_load: bool = False
    controls_pressure: bool = True

    @cached_property
    def constants(self) -> dict[str, int]:
        """Indices of the law's own states and parameters by name, those of shared blocks included."""
        modules = dict.fromkeys(
            sys.modules[f.__module__] for f in callees_first(self.step)
        )  # a set of them is unordered
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
