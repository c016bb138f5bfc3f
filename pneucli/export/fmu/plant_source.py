"""The C of the plant: the step function of the kernel with the effects of the model, translated."""

from __future__ import annotations

import ast
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from pneucli.export.c_translator import DOUBLE, CWriter, c_definition, c_signature
from pneucli.export.fmu.lowering import RESULT, Shapes, lower, tuple_lengths
from pneucli.export.type_inference import InferredTypes
from pneucli.physics.declaration import Effect
from pneucli.simulate.build import PARTS, source
from pneucli.simulate.kernel import plant

ROOTS = ("plant_start", "plant_step", "plant_outputs")
C99_MATH = frozenset(
    (
        *("acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "ceil", "copysign", "cos", "cosh", "erf"),
        *("erfc", "exp", "exp2", "expm1", "fabs", "floor", "fmod", "hypot", "isfinite", "isnan", "lgamma", "log"),
        *("log10", "log1p", "log2", "pow", "sin", "sinh", "sqrt", "tan", "tanh", "tgamma", "trunc"),
    )
)  # functions of math.h that do as Python's of the same name
READ_ARRAYS = frozenset(("start", "inputs", "flags", "areas", "areas_2", "base", "th", "on"))
WRITTEN_ARRAYS = frozenset(("s", "s1", "s2", "s_supply", "ring", "outputs", RESULT))
EFFECT_SEPARATOR = "__"  # in the names of the effects' functions, which take scalars only
CONSTANT_PREFIX = "K_"


@dataclass(frozen=True)
class PlantWriter(CWriter):
    """Writes C with loops that end by a condition."""

    STATEMENTS: ClassVar[Mapping[type[ast.stmt], str]] = {ast.Break: "break", ast.Continue: "continue", ast.Pass: ""}

    def statement(self, node: ast.stmt, depth: int) -> list[str]:
        """Return the lines of a statement."""
        pad = "    " * depth
        if isinstance(node, ast.While):
            return [f"{pad}while ({self.expression(node.test)}) {{", *self.block(node.body, depth), f"{pad}}}"]
        if word := self.STATEMENTS.get(type(node)):
            return [f"{pad}{word};"]
        return [] if isinstance(node, ast.Pass) else super().statement(node, depth)

    def callee(self, node: ast.expr) -> str:
        """Return the name of a called function."""
        return "(double)" if isinstance(node, ast.Name) and node.id == "float" else super().callee(node)


def plant_functions(effects: Sequence[Effect], sizes: Mapping[str, tuple[int, ...]]) -> str:
    """Return the plant's functions in C99, with their constants and prototypes.

    Args:
        effects: Effects of the model, in any order; each acts behind its switch.
        sizes: Lengths of the axes of the arrays, by name.

    Returns:
        C text.

    Raises:
        ValueError: A function of an effect has no counterpart in C; the message names it.
    """
    ordered = sorted(effects, key=lambda e: (e.order, e.name))
    module = ast.parse(source(ordered, compiled=False, parts=(*PARTS, plant)))
    every = {node.name: node for node in module.body if isinstance(node, ast.FunctionDef)}
    needed = {name: every[name] for name in every if name in _reachable(every)}
    constants = _constants(module)
    shapes = Shapes(tuple_lengths(needed), sizes, {name: f"{CONSTANT_PREFIX}{name}" for name in constants})
    heads, bodies = [], []
    for name, tree in needed.items():
        try:
            head, body = _definition(tree, shapes)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error
        heads.append(head)
        bodies.append(body)
    text = "\n".join([*(f"{head};" for head in heads), "", "\n\n".join(bodies), ""])
    used = set(re.findall(rf"\b{CONSTANT_PREFIX}(\w+)", text))
    numbers = [f"#define {CONSTANT_PREFIX}{n} {_number(v)}" for n, v in constants.items() if n in used]
    return "\n".join([*numbers, "", text])


def _definition(tree: ast.FunctionDef, shapes: Shapes) -> tuple[str, str]:
    """Return prototype and definition of a function."""
    scalars_only = EFFECT_SEPARATOR in tree.name
    lowered = lower(tree, shapes)
    names = [a.arg for a in tree.args.args]
    arrays = {RESULT: f"double *{RESULT}"}
    if not scalars_only:
        switched = "on" in names
        arrays |= {n: f"const double *{n}" for n in names if n in READ_ARRAYS}
        arrays |= {n: f"double *{n}" for n in names if n in WRITTEN_ARRAYS and (n != "s" or switched)}
    lowered.tree.args = tree.args
    writer = PlantWriter(DOUBLE, C99_MATH)
    head = c_signature(lowered.tree, InferredTypes(lowered.tree), DOUBLE, arrays)
    return head, c_definition(lowered.tree, writer, arrays, lowered.arrays)


def _reachable(functions: Mapping[str, ast.FunctionDef]) -> Collection[str]:
    found: set[str] = set()
    waiting = list(ROOTS)
    while waiting:
        name = waiting.pop()
        if name in functions and name not in found:
            found.add(name)
            waiting += [n.id for n in ast.walk(functions[name]) if isinstance(n, ast.Name)]
    return found


def _constants(module: ast.Module) -> dict[str, float]:
    """Return the numbers that stand at the module's top, by name."""
    found: dict[str, float] = {}
    for node in module.body:
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if not isinstance(value, ast.Tuple):
                found[name] = ast.literal_eval(value)
    return found


def _number(value: float) -> str:
    return repr(value) if isinstance(value, int) else DOUBLE.number(value)
