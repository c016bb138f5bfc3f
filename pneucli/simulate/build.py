"""Build the compiled kernel for a set of effects: write its text, compile it once, keep it on disk.

The cache of numba does not notice edits in other modules, so the name of the file holds a hash of its whole text,
which contains every equation that it runs.
"""

import ast
import hashlib
import inspect
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from threading import Lock
from types import ModuleType, SimpleNamespace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from pneucli import caches
from pneucli.physics import gas
from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.equations import effect_source
from pneucli.physics.ports import PORTS
from pneucli.simulate import dual, layout
from pneucli.simulate.kernel import arrays, balance, chamber, friction, hose, run, sensors, step, table_friction

_LOCK = Lock()  # threads ask for kernels
PARTS = (
    arrays,
    hose,
    chamber,
    friction,
    sensors,
    step,
    run,
    balance,
    table_friction,
)  # in the order of the text
ENTRY_POINTS = (
    "run",
    "run_imposed",
    "run_balance",
    "run_table_friction",
    "run_forces",
    "run_true_pressures",
    "run_gradient",
)

PRECEDING = {port.before: name for name, port in PORTS.items() if port.before is not None}
CALLED = ("advance",)  # twice, and too long to be inlined twice

# the kernel of dual numbers: a recording whose motion is given, from what its gas depends on
DUAL_PARTS = (arrays, hose, chamber, sensors, step, run)
DIFFERENTIABLE = ("rig.dead_volume_1", "rig.dead_volume_2", "rig.supply_pressure", "rig.polytropic_exponent")
DUAL_TEXT = """
P1, P2, R1, R2, GAS_T, FLOW = D_P1, D_P2, D_R1, D_R2, D_GAS_T, D_FLOW
X = V = A = U = D_REST


def new_array(shape):
    return as_duals(np.zeros((*shape, ROW)))


def fixed(number):
    return value_of(number)


def piston_step(x, v, z, rest, dv, p1, p2, driven, h, m, stiffness, base, th, on):
    return x, v, z, rest


def starting_deflection(x, v, p1, p2, driven, stiffness, base, th, on):
    return 0.0


def piston_acceleration(x, v, z, rest, dv, p1, p2, driven, m, stiffness, base, th, on):
    return 0.0


def effective_area(u, u_max, areas):
    table, slopes, places = areas
    i, w = table_place(u, u_max, table.size)
    return table[i] + w * (table[i + 1] - table[i]) + slopes_between(slopes, i, value_of(w), places)


def run_duals(
    time, inputs, restarts, base, th, on, flags, areas, areas_2, h_max, h_given, slopes, slopes_2, places, out
):
    nothing = np.zeros(2)
    run(
        time, inputs, restarts, as_duals(base), as_duals(th), on, flags, (areas, slopes, places),
        (areas_2, slopes_2, places), h_max, h_given, nothing, nothing, as_duals(out),
    )


"""


@dataclass(frozen=True)
class Kernel:
    """A compiled kernel.

    Attributes:
        run: See :func:`pneucli.simulate.kernel.run.run`.
        functions: The functions that Python may call: of a compiled kernel its entry points, else every function.
        effects: Names of the effects in the order of their switches.
        index: Place of each EFFECT.PARAMETER in the vector ``th``.
        declarations: The effects.
    """

    run: Callable[..., None]
    functions: SimpleNamespace
    effects: tuple[str, ...]
    index: dict[str, int]
    declarations: tuple[Effect, ...] = ()

    @cached_property
    def has_duals(self) -> bool:
        """Whether its equations can be differentiated: those of a plug-in may use other functions."""
        return all(dual.is_known(ast.parse(_equations(effect))) for effect in self.declarations)

    @cached_property
    def run_duals(self) -> Callable[..., None]:
        """:func:`pneucli.simulate.kernel.run.run` with dual numbers for base, effects, areas and output."""
        with _LOCK:
            return _build_duals(self.declarations)

    def effect_vector(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the vector ``th`` of values by EFFECT.PARAMETER; those of an effect that is off may be missing."""
        th = np.zeros(len(self.index) + 1)
        for name, value in values.items():
            th[self.index[name]] = value
        return th

    def effect_switches(self, active: Collection[str]) -> NDArray[np.uint8]:
        """Return the vector ``on`` for the named effects."""
        return np.array([name in active for name in self.effects] + [False], dtype=np.uint8)


def build(effects: Sequence[Effect], *, compiled: bool = True, control: str | None = None) -> Kernel:
    """Build the kernel of the base model with effects, each behind a switch.

    Args:
        effects: Effects.
        compiled: Whether to compile; otherwise the same text runs as plain Python, which tests compare and step
            through.
        control: Text of functions that replace ``control`` of :mod:`pneucli.simulate.kernel.run`, which is among them.

    Returns:
        The kernel.
    """
    with _LOCK:
        return _build(tuple(sorted(effects, key=lambda e: (e.order, e.name))), compiled, control)


@cache
def _build(effects: tuple[Effect, ...], compiled: bool, control: str | None) -> Kernel:
    text = source(effects, compiled=compiled, control=control)
    module = _load(text)
    index = {name: i for i, name in enumerate(_parameters_of(effects))}
    # a compiled function without a wrapper ends the process where Python calls it
    named = {name: f for name, f in vars(module).items() if not compiled or name in ENTRY_POINTS}
    return Kernel(module.run, SimpleNamespace(**named), tuple(e.name for e in effects), index, effects)


@cache
def _build_duals(effects: tuple[Effect, ...]) -> Callable[..., None]:
    return cast("Callable[..., None]", _load(_dual_source(effects)).run_duals)


def source(
    effects: Sequence[Effect],
    *,
    compiled: bool = True,
    control: str | None = None,
    parts: Sequence[ModuleType] = PARTS,
) -> str:
    """Return the text of the kernel's module.

    Args:
        effects: Effects.
        compiled: Whether functions have numba's decorators.
        control: Text of functions that replace ``control``.
        parts: Modules of the kernel whose functions stand in the text.

    Returns:
        Python text.

    >>> "def run(" in source(())
    True
    """
    physics = "\n\n\n".join(_functions(part) for part in parts) + "\n"
    if control is not None:
        before, after = re.split(r"^def control\(.*?(?=^def )", physics, flags=re.MULTILINE | re.DOTALL)
        physics = f"{before}{control}\n\n{after}"
    texts = [
        "import math\n\nimport numpy as np\nfrom numba import njit\n\nfrom pneucli.caches import part\n",
        _constants(),
        _functions(gas) + "\n",
        *(_equations(effect) for effect in effects),
        *(_port(name, effects) for name, port in PORTS.items() if port.before is None),
        *(_port(name, effects) for name in ("has_heat", "has_slowing", "has_switched", "has_filling")),
        _scalars(effects),
        physics,
    ]
    text = "\n\n".join(texts)
    return _decorated(text, ENTRY_POINTS, CALLED) if compiled else text


def _dual_source(effects: Sequence[Effect]) -> str:
    """Return the text of the kernel with dual numbers, see :mod:`pneucli.simulate.dual`."""
    gas_ports = {name for name, port in PORTS.items() if port.balance in ("gas", "pressure sensor")}
    free = [not gas_ports.isdisjoint(e.ports) for e in effects for _ in e.parameters]
    numbers = {
        "base": [name in DIFFERENTIABLE for name in layout.BASE_NAMES],
        "th": [*free, False],  # what moves the piston is no number of the gas
    }
    tuples = [
        "".join(f"{name}[{i}], " if is_free else f"value_of({name}[{i}]), " for i, is_free in enumerate(which))
        for name, which in numbers.items()
    ]
    switches = "".join(f"on[{i}], " for i in range(len(effects) + 1))
    scalars = f"def scalars(base, th, on):\n    return {', '.join(f'({one})' for one in (*tuples, switches))}\n"
    rules = hashlib.sha256(inspect.getsource(dual).encode()).hexdigest()
    imports = f"# {rules}\nfrom pneucli.simulate.dual import ROW, as_duals, slopes_between, value_of\n"
    text = imports + source(effects, compiled=False, parts=DUAL_PARTS) + DUAL_TEXT + scalars
    return _decorated(text, ("run_duals",), CALLED)


def _decorated(text: str, entries: Collection[str], called: Collection[str]) -> str:
    return re.sub(
        r"^def (\w+).*?(?=^def |\Z)", partial(_decorate, entries, called), text, flags=re.MULTILINE | re.DOTALL
    )


def _decorate(entries: Collection[str], called: Collection[str], match: re.Match[str]) -> str:
    """Return a function with its decorator.

    All functions but the entry points and those ``called`` are inlined, since calls with arrays are expensive.
    Functions that create no array do not count references to arrays (``_nrt=False``), which took a third of the time; a
    function inherits this setting from its caller without an own one.
    """
    text, name = match[0], match[1]
    how = "njit(cache=True, nogil=True" if name in entries else f"part(forceinline={name not in called}"
    makes_arrays = name in (*entries, *called, "run") or re.search(r"\bnp\.|\.copy\(|\bnew_", text) is not None
    return f"@{how}, _nrt={makes_arrays}, error_model='numpy')\n{text}"


def _constants() -> str:
    modules = (layout, gas, hose, chamber)
    values = {k: v for module in modules for k, v in vars(module).items() if isinstance(v, int | float)}
    return "\n".join(f"{name} = {value}" for name, value in values.items()) + "\n"


def _functions(module: ModuleType) -> str:
    """Return the top-level functions of a module's text without docstrings, so that a reworded one compiles nothing."""
    text = inspect.getsource(module)
    functions = [node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    docstrings = [node.body[0] for node in functions if ast.get_docstring(node) is not None]
    dropped = {line for one in docstrings for line in range(one.lineno, (one.end_lineno or one.lineno) + 1)}
    lines = enumerate(text.splitlines(), 1)
    return "\n".join(line for i, line in lines if i >= functions[0].lineno and i not in dropped)


def _prefix(effect: Effect) -> str:
    return re.sub(r"\W", "_", effect.name)


@cache
def _equations(effect: Effect) -> str:
    """Return the effect's port functions and helpers, under unique names."""
    return effect_source(effect, _prefix(effect)) + "\n"


def _port(name: str, effects: Sequence[Effect]) -> str:
    """Return the function of one port, which combines the effects that enter there."""
    if name.startswith("has_"):
        users = [i for i, e in enumerate(effects) if name.removeprefix("has_") in e.ports]
        return f"def {name}(on):\n    return " + (" or ".join(f"on[{i}] != 0" for i in users) or "False")
    port = PORTS[name]
    shown = [a for a in port.arguments if a != "s"] + (["s"] if port.combine == "state" else [])
    value = port.arguments[0] if port.combine in ("chain", "state") else "total"
    lines = [f"def {name}({', '.join([*shown, 'th', 'on'])}):"]
    if value == "total":
        lines.append(f"    total = {1.0 if port.combine == 'factor' else 0.0}")
    begins = np.cumsum([0, *(len(effect.parameters) for effect in effects)]).tolist()
    users = [i for i, effect in enumerate(effects) if name in effect.ports]
    for i in reversed(users) if name.startswith("unread") else users:  # an inverse undoes the last first
        acting = [p for p in (PRECEDING.get(name), name) if p in effects[i].ports]
        states = f"s[{i}]", f"s[{len(effects) + 1 + i}]"
        lines += [f"    if on[{i}] != 0:"]
        lines += ["        " + _port_contribution(p, effects[i], states, begins[i], value) for p in acting]
    return "\n".join([*lines, f"    return {value}"])


def _scalars(effects: Sequence[Effect]) -> str:
    """Return the function that unpacks the parameters once a run: tuples live in registers."""
    sizes = {"base": len(layout.BASE_NAMES), "th": len(_parameters_of(effects)), "on": len(effects)}
    tuples = [
        f"({''.join(f'{name}[{i}], ' for i in range(size + 1 - (name == 'base')))})" for name, size in sizes.items()
    ]
    return "def scalars(base, th, on):\n    return " + ", ".join(tuples)


def _port_contribution(name: str, effect: Effect, states: tuple[str, str], begin: int, value: str) -> str:
    port = PORTS[name]
    own, other = states if port.before is None else states[::-1]
    arguments = [{"s": own, "opening": other}.get(a, a) for a in port.arguments]
    arguments += [f"th[{begin + j}]" for j in range(len(effect.parameters))]
    call = f"{_prefix(effect)}__{effect.ports[name].__name__}({', '.join(arguments)})"
    return {
        "sum": f"total += {call}",
        "factor": f"total *= {call}",
        "chain": f"{value} = {call}",
        "state": f"{value}, {own} = {call}",
    }[port.combine]


def _load(text: str) -> ModuleType:
    return caches.import_generated(text, "pneucli_kernel")


def _parameters_of(effects: Sequence[Effect]) -> dict[str, Parameter]:
    """Return every parameter of effects."""
    return {f"{e.name}.{p.name}": p for e in effects for p in e.parameters}
