"""Source text of the controller for the simulation kernel: constants, functions of all laws, and the loop.

What a law is and which there are: docs/design.md.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

import inspect
import math
from collections.abc import Mapping
from functools import cache
from types import FunctionType

from pneucli.controller import layout
from pneucli.controller.commissioning import commission, run_commissioning, watch_limit_cycle
from pneucli.controller.laws import LAWS
from pneucli.controller.laws.base import callees_first
from pneucli.controller.layout import *
from pneucli.controller.operation import (
    active_reference,
    close_valves,
    enable,
    finish_commands,
    pause,
    reset,
    set_supply,
    track_commands,
)
from pneucli.controller.reference import set_level
from pneucli.controller.valve_dynamics import null_command_1, null_command_2
from pneucli.physics import gas

DISPATCH_FUNCTION = "step_law"  # of :mod:`pneucli.controller.codegen`


@cache
def controller_source() -> str:
    """Return the source of all laws for the kernel: constants, functions, and the dispatch between them."""
    roots = [*(law.step for law in LAWS.values()), control]
    needed = {f.__name__: f for root in roots for f in callees_first(root) if f.__module__ != gas.__name__}
    needed.pop(DISPATCH_FUNCTION)
    around = [_source(f) for f in needed.values() if f.__module__ == __name__]
    within = [_source(f) for f in needed.values() if f.__module__ != __name__]
    return "\n\n\n".join([_constants(), *within, _dispatch_source(), *around])


def _source(function: FunctionType) -> str:
    return inspect.getsource(function).rstrip()


def _constants() -> str:
    common = {n: v for n, v in vars(layout).items() if n[:2] in ("S_", "C_", "L_") and isinstance(v, int)}
    own: dict[str, int] = {}
    for law in LAWS.values():
        _add_constants(own, law.constants)
    return "\n".join(f"{name} = {value}" for name, value in (common | own).items())


def _add_constants(known: dict[str, int], more: Mapping[str, int]) -> None:
    """Add constants; raises ValueError where a name has two places, which one text cannot hold."""
    for name, value in more.items():
        if known.setdefault(name, value) != value:
            raise ValueError(f"{name} stands for two places")


def _dispatch_source() -> str:
    lines = [f"def {DISPATCH_FUNCTION}(which, x_ref, x, p1, p2, s, c):"]
    for i, law in enumerate(LAWS.values()):
        lines += [f"    if which == {i}:", f"        {law.step.__name__}(x_ref, x, p1, p2, s, c)"]
    return "\n".join(lines)


def quantize(value, quantum):
    """Return ``value`` rounded to multiples of ``quantum``; unchanged for quantum 0 or a missing value."""
    return quantum * math.floor(value / quantum + 0.5) if quantum > 0.0 and math.isfinite(value) else value


def step_law(which: int, x_ref, x, p1, p2, s, c):
    """Advance the law with the index ``which`` of LAWS; the kernel replaces this function by a dispatch.

    ``x_ref`` is the reference in m, or in Pa of a controller of pressure; ``x`` the read position in m; ``p1`` and
    ``p2`` the read pressures in Pa.
    """
    tuple(LAWS.values())[which].step(x_ref, x, p1, p2, s, c)


def operate(which: int, x_ref, x, p1, p2, supply, duty, level, s, c):
    """Run one sample of a law with its operation: measured supply (Pa, 0: none), operating mode, pressure level.

    ``duty`` is an index of ``OPERATING_MODES``; ``level`` the set mean pressure (Pa, 0: as designed); ``which``,
    ``x_ref``, ``x``, ``p1`` and ``p2`` are those of :func:`step_law`.
    """
    set_supply(supply, s, c)
    set_level(level, s, c)
    enable(0.0 if duty == 2.0 else 1.0, s)
    pause(1.0 if duty == 1.0 else 0.0, s)
    if duty == 3.0:
        reset(x, p1, p2, s[S_U1], s[S_U2], s, c)
    if duty == 5.0:
        commission(0.0, 0.0, s, c)
    if s[S_DISABLED] > 0.5:
        close_valves(s, c)
    elif not run_commissioning(x, p1, p2, s, c):
        step_law(which, active_reference(x_ref, x, p1, p2, s, c), x, p1, p2, s, c)
        finish_commands(s, c)
        watch_limit_cycle(x, s, c)


def control(k, x_ref, x, p1, p2, cs, cp):
    """Run one sample of the controller in the loop: ``cs`` holds its state, followed by one log row a sample.

    ``k`` is the number of the sample, ``x_ref`` the reference, ``x`` the true position in m, ``p1`` and ``p2`` the true
    pressures in Pa. The last four of ``cp`` are the quanta of position (m) and pressure (Pa), the delay in samples,
    and the index of the law. Returns the commands of both valves in V that arrive at this sample.
    """
    settings: int = cp.size - 4
    row: int = L_STATES + k * L_ROW
    read_x = quantize(x + cs[row + L_NOISE_X], cp[settings])
    read_p1 = quantize(p1 + cs[row + L_NOISE_P1], cp[settings + 1])
    read_p2 = quantize(p2 + cs[row + L_NOISE_P2], cp[settings + 1])
    supply, duty, level = cs[row + L_SUPPLY], cs[row + L_MODE], cs[row + L_LEVEL]
    if duty == 4.0:
        track_commands(cs[row + L_U1], cs[row + L_U2], cs, cp)
    operate(int(cp[settings + 3]), x_ref, read_x, read_p1, read_p2, supply, duty, level, cs, cp)
    cs[row + L_READ_X], cs[row + L_READ_P1], cs[row + L_READ_P2] = read_x, read_p1, read_p2
    cs[row + L_U1], cs[row + L_U2], cs[row + L_LOAD] = cs[S_U1], cs[S_U2], cs[S_LOAD]
    cs[row + L_P1_REF], cs[row + L_P2_REF], cs[row + L_FLOW1] = cs[S_P1_REF], cs[S_P2_REF], cs[S_FLOW1]
    cs[row + L_X_SHAPED], cs[row + L_V], cs[row + L_FORCE] = cs[S_X_SHAPED], cs[S_V], cs[S_FORCE]
    late: int = k - int(cp[settings + 2])
    if late < 0:
        return null_command_1(cp), null_command_2(cp)
    return cs[L_STATES + late * L_ROW + L_U1], cs[L_STATES + late * L_ROW + L_U2]
