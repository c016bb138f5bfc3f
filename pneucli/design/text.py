"""Scalar functions as text: which a law needs, in what order, and what the simulation kernel gets of all laws."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from functools import cache
from types import FunctionType

from pneucli.design import layout, loop
from pneucli.design.callees import callees_first
from pneucli.design.laws import LAWS
from pneucli.physics import gas

DISPATCH = "any_law"  # of :mod:`pneucli.design.loop`


@cache
def controller_text() -> str:
    """Return all laws as text for the kernel: constants, functions, and the choice between them."""
    roots = [*(law.step for law in LAWS.values()), loop.control]
    needed = {f.__name__: f for root in roots for f in callees_first(root) if f.__module__ != gas.__name__}
    needed.pop(DISPATCH)
    around = [_source(f) for f in needed.values() if f.__module__ == loop.__name__]
    within = [_source(f) for f in needed.values() if f.__module__ != loop.__name__]
    return "\n\n\n".join([_constants(), *within, _dispatch(), *around])


def _source(function: FunctionType) -> str:
    return inspect.getsource(function).rstrip()


def _constants() -> str:
    common = {n: v for n, v in vars(layout).items() if n[:2] in ("S_", "C_", "L_") and isinstance(v, int)}
    own: dict[str, int] = {}
    for law in LAWS.values():
        _join(own, law.constants)
    return "\n".join(f"{name} = {value}" for name, value in (common | own).items())


def _join(known: dict[str, int], more: Mapping[str, int]) -> None:
    """Add constants; raises ValueError where a name has two places, which one text cannot hold."""
    for name, value in more.items():
        if known.setdefault(name, value) != value:
            raise ValueError(f"{name} stands for two places")


def _dispatch() -> str:
    lines = [f"def {DISPATCH}(which, x_ref, x, p1, p2, s, c):"]
    for i, law in enumerate(LAWS.values()):
        lines += [f"    if which == {i}:", f"        {law.step.__name__}(x_ref, x, p1, p2, s, c)"]
    return "\n".join(lines)
