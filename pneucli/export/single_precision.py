"""The controller in single precision, as exported with ``--precision float32``: what it answers to given readings.

The functions of the controller run as they are, on numbers of numpy's single precision, whose arithmetic with Python's
own literals stays single; the square root of a single number is rounded to one, as C's ``sqrtf`` is.
"""

import math
from collections.abc import Callable, Mapping
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.controller import codegen, layout, operation
from pneucli.controller.laws import LAWS
from pneucli.controller.laws.base import callees_first
from pneucli.controller.parameters import Controller
from pneucli.export.controller_program import controller_functions
from pneucli.messages.export import PrecisionCost

SINGLE_PRECISION_MATH = SimpleNamespace(
    sqrt=lambda value: np.float32(math.sqrt(value)), fabs=lambda value: np.float32(abs(value)), isfinite=math.isfinite
)


COMPARISON_INTERVAL = 10  # samples, of those at which the difference is taken


def run_in_single_precision(controller: Controller, vectors: Mapping[str, Array]) -> tuple[Array, PrecisionCost]:
    """Return what the controller answers to the readings of a replay file, by its columns, each of shape (n,).

    The commands in V in single precision have shape (n, 2). The samples that are compared with double precision start
    from the same state: left to itself a replay drifts, as no axis answers.
    """
    single, which = _single_precision_functions(controller.law)["operate"], list(LAWS).index(controller.law)
    double: Callable[..., None] = codegen.operate
    numbers, state = controller.vector(), np.zeros(layout.L_STATES)
    numbers_32, state_32 = numbers.astype(np.float32), state.astype(np.float32)
    columns = [vectors[name].tolist() for name in ("x_ref", "x", "p1", "p2", "supply", "duty", "level")]
    out, off = np.zeros((len(columns[0]), 2)), []
    with np.errstate(all="ignore"):
        for k, row in enumerate(zip(*columns, strict=True)):
            row_32 = tuple(map(np.float32, row))
            before = state.astype(np.float32) if k % COMPARISON_INTERVAL == 0 else None
            numbers_before = numbers.astype(np.float32) if before is not None else numbers_32
            double(which, *row, state, numbers)
            single(which, *row_32, state_32, numbers_32)
            out[k] = state_32[layout.S_U1], state_32[layout.S_U2]
            if before is not None:
                single(which, *row_32, before, numbers_before)
                off.append([before[i] - state[i] for i in (layout.S_U1, layout.S_U2)])
    far = np.abs(off).max(axis=1)
    p99 = float(np.percentile(far, 99.0))
    return out, PrecisionCost(float(np.sqrt(np.mean(far[far <= p99] ** 2))), p99, float(far.max()))


def replay_in_single_precision(controller: Controller, signals: Mapping[str, Array], start: str) -> Array:
    """Return :func:`pneucli.closed_loop.simulation.replay_log` in single precision; commands and estimates alone."""
    world, numbers = _single_precision_functions(controller.law), controller.vector().astype(np.float32)
    state, n = np.zeros(layout.L_STATES, dtype=np.float32), signals["x_ref"].size
    rows, missing = np.zeros((n, layout.L_ROW)), np.full(n, np.nan)
    read = [signals.get(name, missing).astype(np.float32) for name in ("x_ref", "x", "p1", "p2")]
    supply, duty = np.nan_to_num(signals.get("p_supply", np.zeros(n))).astype(np.float32), np.zeros(n, dtype=np.float32)
    if start == "commission":
        duty[0] = layout.OPERATING_MODES.index("commission")
    if start == "before":
        duty[0] = layout.OPERATING_MODES.index("reset")
        for place, name in ((layout.S_U1, "u"), (layout.S_U2, "u2")):
            state[place] = np.nan_to_num(signals[name][0]) if name in signals else 0.0
    zeros = np.zeros(n)
    logged = np.nan_to_num(np.column_stack([signals.get(u, zeros) for u in ("u", "u2")])).astype(np.float32)
    kept = {layout.L_U1: layout.S_U1, layout.L_U2: layout.S_U2, layout.L_LOAD: layout.S_LOAD}
    kept[layout.L_FLOW1] = layout.S_FLOW1
    with np.errstate(all="ignore"):
        for k, readings in enumerate(zip(*read, strict=True)):
            if start == "before" and k > 0:
                world["track_commands"](*logged[k - 1], state, numbers)
            world["operate"](0, *readings, supply[k], duty[k], np.float32(0.0), state, numbers)
            rows[k, list(kept)] = state[list(kept.values())]
    return rows


def _single_precision_functions(law: str) -> dict[str, Any]:
    """Return the law's functions by name, bound to each other and to the mathematics of single precision."""
    world: dict[str, Any] = {"__builtins__": __builtins__, "math": SINGLE_PRECISION_MATH, **_constants(law)}
    for function in [
        *controller_functions(law),
        *callees_first(codegen.operate),
        *callees_first(operation.track_commands),
    ]:
        world[function.__name__] = FunctionType(function.__code__, world, function.__name__, function.__defaults__)
    step = world[LAWS[law].step.__name__]
    world["step_law"] = lambda _which, *arguments: step(*arguments)
    return world


def _constants(law: str) -> dict[str, Any]:
    """Return the places and the physical constants that the functions name."""
    found = {n: v for f in controller_functions(law) for n, v in f.__globals__.items() if isinstance(v, int | float)}
    return {n: np.float32(v) if isinstance(v, float) else v for n, v in found.items()}
