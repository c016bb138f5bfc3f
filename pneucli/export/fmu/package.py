"""Write the FMU: its C, its descriptions, its binary of this platform, and the archive."""

from __future__ import annotations

import ast
import hashlib
import html
import math
import re
import shutil
import subprocess
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, ClassVar
from xml.etree import ElementTree
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np

from pneucli.errors import InputError
from pneucli.export.c_source import DOUBLE, CWriter, c_definition, c_signature
from pneucli.export.controller_program import fill_template
from pneucli.export.fmu.lowering import RESULT, Shapes, lower, tuple_lengths
from pneucli.export.fmu.plant import Plant, Variable, c_tables, variables_of
from pneucli.export.type_inference import InferredTypes
from pneucli.imports import library_of_extra
from pneucli.io.artifacts import atomic_path
from pneucli.messages.export import PlantAnswer
from pneucli.physics.declaration import Effect
from pneucli.simulate import layout as at
from pneucli.simulate.build import PARTS, source
from pneucli.simulate.kernel import plant
from pneucli.units import parse_unit
from pneucli.version import __version__

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription, ModelVariable, Unit

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
MODEL_IDENTIFIER = "pneucli_plant"
SOURCE_FILE = "pneucli_plant.c"
BUILD_FILE = "buildDescription.xml"  # how another platform compiles the sources, from FMI 3.0 on
FILE_NAME = "pneucli_plant.fmu"
STEP = 1e-3  # s, the communication step that an importer takes by default, and between events of model exchange
RING_MARGIN = 8.0  # times the delay of a hose: the parameter may be set higher before the start
MIN_RING_ROWS = 2048
RING_COLUMNS = 5
DELAY_PORTS = ("flow_delay", "flow_delay_1", "flow_delay_2")
HEADERS = {
    "3.0": ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
    "2.0": ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
}
REAL = {"3.0": "Float64", "2.0": "Real"}  # the type of variables in the description
LIBRARIES = {"CMAKE_C_STANDARD_LIBRARIES:STRING": "-lm"}  # elsewhere math.h is part of the library of C


def token_of(sources: Sequence[str]) -> str:
    """Return the instantiation token: it changes with any of the sources."""
    return "{" + hashlib.sha256("\n".join(sources).encode()).hexdigest()[:32] + "}"


def model_description(
    name: str, title: str, token: str, variables: Sequence[Variable], step: float, fmi: str = "3.0"
) -> ModelDescription:
    """Return the description of the FMU.

    Args:
        name: Name of the model.
        title: What it is.
        token: Instantiation token.
        variables: Its variables.
        step: Communication step in s that an importer takes by default; of model exchange, time between events.
        fmi: Version of the standard, ``3.0`` or ``2.0``.
    """
    from fmpy.model_description import CoSimulation, DefaultExperiment, ModelDescription, ModelExchange, Unknown  # noqa: PLC0415 - an extra

    written = [_time(REAL[fmi]), *(_variable(one, REAL[fmi]) for one in variables)]
    outputs = [one for one in written if one.causality == "output"]
    return ModelDescription(
        fmiVersion=fmi,
        modelName=name,
        instantiationToken=token,
        description=title,
        generationTool=f"pneucli {__version__}",
        variableNamingConvention="flat",
        defaultExperiment=DefaultExperiment(startTime="0", stopTime="10", stepSize=repr(step)),
        modelExchange=ModelExchange(
            modelIdentifier=MODEL_IDENTIFIER, canGetAndSetFMUstate=True, canSerializeFMUstate=True
        ),
        coSimulation=CoSimulation(
            modelIdentifier=MODEL_IDENTIFIER,
            canHandleVariableCommunicationStepSize=True,
            canGetAndSetFMUstate=True,
            canSerializeFMUstate=True,
        ),
        unitDefinitions=[_unit(unit) for unit in dict.fromkeys(one.unit for one in variables)],
        modelVariables=written,
        outputs=[Unknown(variable=one) for one in outputs],
        initialUnknowns=[Unknown(variable=one) for one in outputs],
    )


def _time(real: str) -> ModelVariable:
    from fmpy.model_description import ModelVariable  # noqa: PLC0415 - an extra

    about = {"causality": "independent", "variability": "continuous", "description": "time", "unit": "s"}
    return ModelVariable(name="time", valueReference=0, type=real, **about)


def _variable(one: Variable, real: str) -> ModelVariable:
    from fmpy.model_description import ModelVariable  # noqa: PLC0415 - an extra

    variability = "fixed" if one.kind == "parameter" else "continuous"
    return ModelVariable(
        name=one.name,
        valueReference=one.reference,
        type=real,
        causality=one.kind,
        variability=variability,
        unit=one.unit,
        description=one.description,
        start=None if one.start is None else repr(one.start),
        min=repr(one.lowest) if math.isfinite(one.lowest) else None,
        max=repr(one.highest) if math.isfinite(one.highest) else None,
    )


def _unit(text: str) -> Unit:
    """Return a unit with its exponents of SI base units."""
    from fmpy.model_description import BaseUnit, Unit  # noqa: PLC0415 - an extra

    unit = parse_unit(text)
    m, kg, s, K, A = unit.dimension
    return Unit(name=text, baseUnit=BaseUnit(m=m, kg=kg, s=s, K=K, A=A, factor=unit.factor, offset=unit.offset))


def write_fmu(folder: Path, plant: Plant, where: str, fmi: str = "3.0") -> PlantAnswer:
    """Write ``pneucli_plant.fmu``.

    Args:
        folder: Folder of the file.
        plant: The plant.
        where: The place of the model in the pipeline file, for messages.
        fmi: Version of the standard, ``3.0`` or ``2.0``.

    Returns:
        What an importer finds.

    Raises:
        InputError: FMPy is not installed, or an effect has Python without a counterpart in C.
    """
    library_of_extra("fmpy", "fmu", "--to fmu", "FMPy")
    variables = variables_of(plant)
    sources = _sources(plant, where, fmi)
    with TemporaryDirectory() as name:
        root = Path(name) / "fmu"
        (root / "sources").mkdir(parents=True)
        (root / "documentation").mkdir()
        title = f"Plant of the pipeline {plant.name}: {'an axis' if plant.has_cylinder else 'a vessel'} with its valve"
        about = model_description(plant.name, title, sources.pop("token"), variables, STEP, fmi)
        _write_descriptions(root, about)
        for file, text in sources.items():
            (root / "sources" / file).write_text(text, encoding="utf-8")
        _copy_headers(root / "sources", HEADERS[fmi])
        (root / "documentation" / "index.html").write_text(_documentation(plant, title, variables), encoding="utf-8")
        binaries = _compile(root, Path(name) / "build")
        with atomic_path(folder / FILE_NAME) as temporary:
            _archive(root, temporary)
    return PlantAnswer(
        fmi,
        inputs=[v.name for v in variables if v.kind == "input"],
        outputs=[v.name for v in variables if v.kind == "output"],
        parameters={
            v.name: {"value": v.start, "unit": v.unit, "ci95": v.identified.answer["ci95"] if v.identified else None}
            for v in variables
            if v.kind == "parameter"
        },
        effects=[effect.name for effect in plant.effects],
        binaries=binaries,
        max_step_s=plant.max_step,
    )


def _write_descriptions(root: Path, about: ModelDescription) -> None:
    """Write the description, and what another platform compiles: in FMI 2.0 a part of it, in FMI 3.0 a file.

    FMPy writes neither the sources of FMI 2.0 nor the ranges of FMI 3.0.
    """
    from fmpy.model_description import write_model_description  # noqa: PLC0415 - an extra

    path = root / "modelDescription.xml"
    write_model_description(about, path)
    tree = ElementTree.parse(path)
    if about.fmiMajorVersion == 3:
        (root / "sources" / BUILD_FILE).write_text(fill_template(BUILD_FILE), encoding="utf-8")
        for one, element in zip(about.modelVariables, tree.getroot().iter(REAL["3.0"]), strict=True):
            element.attrib |= {key: text for key in ("min", "max") if (text := getattr(one, key)) is not None}
    else:
        for interface in ("ModelExchange", "CoSimulation"):
            element = tree.getroot().findall(interface)[0]
            ElementTree.SubElement(ElementTree.SubElement(element, "SourceFiles"), "File", name=SOURCE_FILE)
    tree.write(path, encoding="utf-8", xml_declaration=True)


def _archive(root: Path, target: Path) -> None:
    """Write an archive of a folder that is the same for the same files: sorted, without their times."""
    with ZipFile(target, "w", ZIP_DEFLATED) as archive:
        for path in sorted(root.rglob("*")):
            if path.is_file():
                about = ZipInfo(path.relative_to(root).as_posix())  # its date is the first that an archive can hold
                about.external_attr = 0o644 << 16
                archive.writestr(about, path.read_bytes(), ZIP_DEFLATED)


def _sources(plant: Plant, where: str, fmi: str) -> dict[str, str]:
    """Return the text of each C file by name, and the token that follows from them."""
    rows, n = _ring_rows(plant), len(plant.effects) + 1
    sizes = {"areas": plant.areas.shape, "areas_2": plant.areas_2.shape, "ring": (rows, RING_COLUMNS)}
    sizes |= {"s1": (2 * n,), "s2": (2 * n,), "s_supply": (n,)}
    try:
        functions = plant_functions(plant.effects, sizes)
    except ValueError as error:
        wanted = "arithmetic, if, for over a range, and functions of math.h"
        raise InputError(where, f"an effect cannot be written in C: {error}", wanted, code="E064") from error
    tables = c_tables(plant)
    token = token_of([functions, tables, __version__])
    about = {"PIPELINE": plant.name.replace("*/", "* /"), "VERSION": __version__}
    core = fill_template(
        "plant_core.h",
        **about,
        TOKEN=token,
        N_BASE=str(len(at.BASE_NAMES)),
        N_TH=str(len(plant.th)),
        N_STATES=str(at.PLANT_STATES),
        N_EFFECTS=str(n),
        RING_ROWS=str(rows),
        TABLE_POINTS=str(plant.areas.size),
        SAMPLE=repr(STEP),
        LOWER_END=str(at.BASE_NAMES.index("rig.lower_end")),
        UPPER_END=str(at.BASE_NAMES.index("rig.upper_end")),
    )
    main = fill_template(f"plant_fmi{fmi[0]}.c", **about)
    return {
        SOURCE_FILE: main,
        "plant_core.h": core,
        "plant_model.h": functions,
        "plant_tables.h": tables,
        "token": token,
    }


def _ring_rows(plant: Plant) -> int:
    """Return how many entries the ring buffer of the hoses has; one without a hose that delays."""
    delays = [
        plant.th[f"{e.name}.{p.name}"]
        for e in plant.effects
        if set(DELAY_PORTS) & e.ports.keys()
        for p in e.parameters
        if p.unit == "s"
    ]
    return max(MIN_RING_ROWS, int(np.ceil(RING_MARGIN * sum(delays) / plant.max_step))) if delays else 1


def _copy_headers(folder: Path, names: Iterable[str]) -> None:
    """Copy the headers of the standard, which FMPy brings with it (2-clause BSD licence, in the files)."""
    import fmpy  # noqa: PLC0415 - an extra

    for name in names:
        shutil.copyfile(Path(fmpy.__file__).parent / "c-code" / name, folder / name)


def _compile(root: Path, build: Path) -> list[str]:
    """Compile the sources with FMPy's settings for CMake; return the platforms of the binaries."""
    import fmpy  # noqa: PLC0415 - an extra
    from cmake import CMAKE_BIN_DIR  # noqa: PLC0415 - comes with FMPy
    from fmpy.build import create_cmake_settings  # noqa: PLC0415 - an extra

    build.mkdir()
    create_cmake_settings(root, build, cmake_options=dict(LIBRARIES) if fmpy.system != "windows" else {})
    cmake, lists = str(Path(CMAKE_BIN_DIR) / "cmake"), str(Path(fmpy.__file__).parent / "c-code")
    for arguments in (
        ["-S", lists, "-B", str(build)],
        ["--build", str(build), "--target", "install", "--config", "Release"],
    ):
        if subprocess.run([cmake, *arguments], capture_output=True, check=False).returncode != 0:
            return []
    return sorted(path.name for path in (root / "binaries").iterdir() if any(path.glob(f"{MODEL_IDENTIFIER}.*")))


def _documentation(plant: Plant, title: str, variables: Sequence[Variable]) -> str:
    """Return a page for people: the variables with units, values and intervals."""
    rows = [(v.kind, v.name, "" if v.start is None else f"{v.start:.6g}", v.unit, v.description) for v in variables]
    head = "".join(f"<th>{word}</th>" for word in ("kind", "name", "value", "unit", "meaning"))
    body = "\n".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    effects = ", ".join(effect.name for effect in plant.effects) or "none"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title></head>\n'
        f"<body><h1>{html.escape(title)}</h1>\n"
        f"<p>Effects: {html.escape(effects)}. Written by pneucli {__version__}.</p>\n"
        f"<table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></body></html>\n"
    )


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
