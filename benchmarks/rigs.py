"""Rigs of the exam for other benchmarks: exact models, a compiled loop, short pipelines, small inputs.

The loop joins the code of :mod:`pneucli.controller.cascade` with the exam's rig, which shares no code with the model.
The exported C is a translation of it that gives the same commands to the last bit (``tests/export``).

With ``--small`` a benchmark runs to its end in seconds and measures nothing. A pipeline that a benchmark otherwise
identifies is then replaced by the exact model of the rig.
"""

import argparse
import hashlib
import inspect
import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from pneucli.arrays import Array
from pneucli.caches import compiled, import_generated
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.config import load
from pneucli.controller import codegen, layout
from pneucli.controller.laws import LAWS
from pneucli.controller.laws.base import callees_first
from pneucli.controller.parameters import Controller
from pneucli.design.cascade_design import design_cascade
from pneucli.design.requirements import Requirements
from pneucli.exam.cases import generate_case, prepare_case, seal
from pneucli.exam.conditions import parse
from pneucli.exam.hidden_effects import BY_NAME
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig import kernel, parameters, simulation
from pneucli.exam.rig.excitations import closed_loop, two_sine_reference, valve_staircase, valve_step
from pneucli.exam.rig.kernel import MAX_STEP, P1, P2, PS, T1, T2, XL, X
from pneucli.exam.rig.parameters import FIVE_THREE, ONE_CHAMBER, TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig.simulation import Excitation, empty_delay_line, limit_opening, step_rig
from pneucli.export.export_files import write_c, write_c_source
from pneucli.physics import gas
from pneucli.physics.effects import catalogue
from pneucli.pipeline.graph import Context
from pneucli.recording import Rig
from pneucli.simulate.model import Model
from pneucli.simulate.valve_forms import ValveArea
from pneucli.stages import ingest
from pneucli.stages.pipeline_data import PipelineData

COMMANDS = (0.4, 0.7, 1.0, 2.0, 3.5, 5.0, 7.5, 10.0)  # V, at which a valve test would be made


def model_of(par: Parameters, effects: tuple[str, ...] = ()) -> Model:
    """Return the model that knows a rig and, of its effects, those named."""
    rig = Rig(
        gas_temperature=par.temperature, ambient_pressure=par.ambient, supply_pressure=par.supply,
        piston_area_1=par.piston_area_1, piston_area_2=par.piston_area_2, stroke=par.stroke,
        dead_volume_1=par.dead_volume_1, dead_volume_2=par.dead_volume_2, moving_mass=par.mass,
        valve_arrangement={FIVE_THREE: "5/3", TWO_VALVES: "two"}.get(par.arrangement), valve_null=par.command_null,
    )  # fmt: skip
    known = par._replace(overlap=0.0, overlap_2=0.0) if "valve-deadband" in effects else par
    valve = _map(known, known.effective_area, known.overlap, known.exponent)
    second = _map(known, known.effective_area_2, known.overlap_2, known.exponent_2) if par.effective_area_2 else None
    values = {"friction.coulomb": par.coulomb, "friction.viscous": par.viscous}
    for name in effects:
        values |= {f"{name}.{key}": value for key, value in BY_NAME[name].true_parameters(par).items()}
    second = None if second is None else replace(second, label="valve_2")
    return Model(rig, tuple(catalogue()[name] for name in effects), values, valve, second)


def _map(par: Parameters, largest: float, overlap: float, exponent: float) -> ValveArea:
    """Return the map of one chamber's paths as a valve test at ``COMMANDS`` would give it."""
    scale = par.command_range / 10.0

    def area(u: float) -> float:
        return largest * (max(u - overlap, 0.0) / (par.command_range - overlap)) ** exponent

    opened = [scale * u for u in COMMANDS if area(scale * u) > 0.0]
    commands = (*(-u for u in reversed(opened)), *opened)
    return ValveArea(commands, tuple(area(abs(u)) for u in commands), overlap, overlap)


@cache
def compiled_loop(law: str) -> Any:
    """Return :func:`_loop` with a law's sample, compiled; a module in the cache holds both, to be compiled once."""
    return import_generated(_loop_source(law), f"benchmark_{law.replace('-', '_')}")._loop


def _loop_source(law: str) -> str:
    functions = [f for f in callees_first(codegen.operate) if f.__name__ != codegen.DISPATCH_FUNCTION]
    functions = list({f.__name__: f for f in [*callees_first(LAWS[law].step), *functions]}.values())
    names = {**vars(layout), **LAWS[law].constants, **{n: v for n, v in vars(gas).items() if isinstance(v, float)}}
    values = [f"{name} = {value!r}" for name, value in names.items() if isinstance(value, int | float)]
    rig = "".join(inspect.getsource(module) for module in (kernel, parameters, simulation))  # numba sees no edit there
    imports = [
        "import math",
        "import numpy as np",
        "from numba import njit",
        "from benchmarks.rigs import read, supplied",
        f"from {kernel.__name__} import MAX_STEP, P1, P2, PS, T1, T2, XL, X",
        f"from {parameters.__name__} import TWO_VALVES",
        f"from {simulation.__name__} import empty_delay_line, limit_opening, step_rig",
    ]
    step = LAWS[law].step.__name__
    dispatch = f"def {codegen.DISPATCH_FUNCTION}(which, x_ref, x, p1, p2, s, c):\n    {step}(x_ref, x, p1, p2, s, c)\n"
    texts = [inspect.getsource(one) for one in functions]
    place = next(i for i, one in enumerate(functions) if one.__name__ == step) + 1
    texts[place:place] = [dispatch]
    compiled_texts = [f"@njit(cache=True, nogil=True)\n{text}" for text in [*texts, inspect.getsource(_loop)]]
    return "\n".join([f"# {hashlib.sha256(rig.encode()).hexdigest()}", *imports, *values, *compiled_texts])


@dataclass(frozen=True)
class Trace:
    """What a loop did, one value a sample of the controller: position (m), command (V), the state; air in kg."""

    x: Array
    u: Array
    air: float
    states: Array


@compiled()
def read(par: Parameters, s: Array, lagged: Array, skewed: Array, row: int, h: float) -> tuple[float, float]:
    """What the sensors of both pressures show after h (s): lag, delay, scale and offset, in the rig's own order."""
    now = (s[P1], s[P2])
    for i in range(2):
        if par.pressure_lag > 0.0:
            lagged[i] += (now[i] - lagged[i]) * (1.0 - math.exp(-h / par.pressure_lag))
        else:
            lagged[i] = now[i]
        skewed[row % len(skewed), i] = lagged[i]
    late = skewed[(row + 1) % len(skewed)]
    above = par.pressure_scale
    return par.ambient + above * (late[0] - par.ambient) + par.pressure_offset, par.ambient + above * (
        late[1] - par.ambient
    )


@compiled()
def supplied(par: Parameters, s: Array) -> Parameters:
    """Return a rig after its supply pressure is that of its parameters, where no volume delays it."""
    if par.supply_volume == 0.0:
        s[PS] = par.supply
    return par


def _loop(par, pushed, starved, c, cs, every, period, inputs, noise, quantum, is_open, start, out):  # type: ignore[no-untyped-def]
    s, o, work, rest, air = np.zeros(10), np.zeros(2), np.zeros((3, 10)), 1.0, 0.0
    spools, line = np.zeros(6), empty_delay_line(par, MAX_STEP)
    s[X], s[P1], s[P2] = start[0], start[1], start[2]
    s[XL], s[T1], s[T2], s[PS] = s[X], par.temperature, par.temperature, par.supply
    lagged = np.array([s[P1], s[P2]])
    skewed = np.empty((round(par.pressure_skew / period) + 1, 2))
    skewed[:, 0], skewed[:, 1] = s[P1], s[P2]
    for k in range(len(inputs)):
        reference, load, mode, is_starved = inputs[k, 0], inputs[k, 1], inputs[k, 2], inputs[k, 3]
        out[k, 0] = s[X]
        p1, p2 = read(par, s, lagged, skewed, k, period)
        seen = s[X]
        if quantum > 0.0:
            seen = quantum * math.floor(seen / quantum + 0.5)
        operate(0, reference, seen + noise[k, 0], p1 + noise[k, 1], p2 + noise[k, 2], 0.0, mode, 0.0, cs, c)  # type: ignore[name-defined]  # noqa: F821 - see compiled_loop
        out[k, 1] = cs[1]
        out[k, 2:] = cs[: len(out[k]) - 2]
        o[0] = limit_opening(par, par.command_sign * (cs[1] - par.command_null))
        o[1] = limit_opening(par, cs[2] - par.command_null) if par.arrangement == TWO_VALVES else 0.0
        now = supplied(starved if is_starved > 0.5 else pushed if load != 0.0 else par, s)
        for i in range(k * every, (k + 1) * every):
            rest, q = step_rig(now, i, MAX_STEP, o[0], o[1], spools, line, s, rest, is_open, work)
            air += MAX_STEP * (q[0] + q[2])
    return air


def driven(
    par: Parameters, controller: Controller, reference: Array, load: Array, noise: float = 400.0,
    quantum: float = 1e-6, seed: int = 0, is_open: bool = False, *, mode: Array | None = None,
    starved: Array | None = None, lost: Array | None = None, keeps_states: bool = True,
) -> Trace:  # fmt: skip
    """Let a controller follow a ``reference`` (m) under a ``load`` (N toward x = 0, one size) on the rig.

    ``mode`` holds indices of ``layout.OPERATING_MODES``, ``starved`` is 1 where the supply is lost, ``lost`` is NaN
    where a reading of x, p1, p2 (columns) is missing; each a row a sample. States are kept of each sample, or the last.
    """
    p2 = par.ambient if is_open else math.sqrt(par.ambient * par.supply)
    x, n = float(reference[0]), reference.size
    pull = par.constant_force + par.spring_stiffness * (x - par.spring_rest)
    p1 = (pull + p2 * par.piston_area_2 + par.ambient * (par.piston_area_1 - par.piston_area_2)) / par.piston_area_1
    pushed = par._replace(constant_force=par.constant_force + float(np.abs(load).max() * np.sign(load.sum())))
    states = np.zeros(layout.FIRST_LAW_STATE + layout.MAX_LAW_STATES)
    out = np.zeros((n, 2 + states.size * keeps_states))
    noises = np.zeros((n, 3)) if lost is None else lost.copy()
    noises[:, 1:] += noise * np.random.default_rng(seed).standard_normal((n, 2))
    none = np.zeros(n)
    inputs = np.column_stack([reference, load, none if mode is None else mode, none if starved is None else starved])
    air = compiled_loop(controller.law)(
        par, pushed, par._replace(supply=1.02 * par.ambient), controller.vector(), states,
        round(controller.period / MAX_STEP), controller.period, inputs, noises, quantum, int(is_open),
        np.array([x, p1, p2]), out,
    )  # fmt: skip
    return Trace(out[:, 0], out[:, 1], air, out[:, 2:] if keeps_states else states[np.newaxis])


SMALL = "--small"
VESSEL = 160e-6  # m^3
CONTROLLERS = "design/controllers"
VALVE_TEST_STEMS = ("step_+1.0V", "step_+3.0V", "step_+3.5V", "step_+10.0V")  # of a test of a valve; one is held out


def print_tables(tables: Mapping[str, Callable[..., object]], arguments: Sequence[str]) -> int:
    """Print the table that the first argument names, or of each a small one; return 1 where one returned False."""
    is_small = SMALL in arguments
    name, *rest = [one for one in arguments if one != SMALL] or [""]
    if name not in tables and (name or not is_small):
        raise SystemExit(f"no table {name!r}; wanted: {', '.join(tables)}")
    found = [tables[one](rest, is_small=is_small) for one in ([name] if name else tables)]
    return int(any(one is False for one in found))


def study_of(case: Path, folder: Path, most: int | None = None) -> PipelineData:
    """Return a case, ingested into an empty folder, as the stages after ``ingest`` see it."""
    path = case / "pipeline.toml"
    (folder / "ingest").mkdir()
    ingest.run(Context(path, load(path), folder / "ingest", folder))
    return PipelineData(Context(path, load(path), folder / "none", folder), max_samples=most)


def exam(folder: Path) -> Path:
    """Write an exam of one valve test with a lag of the spool; return its folder."""
    seal(folder, "case-001.json", generate_case(folder / "case-001", "valve", ("valve-lag",), "", 1.0, 2))
    shorten(folder / "case-001" / "pipeline.toml")
    return folder


def on_folders(arguments: Sequence[str], print_table: Callable[[list[Path]], None]) -> None:
    """Print the table of the folders that are named, or of a small exam."""
    if SMALL in arguments:
        with tempfile.TemporaryDirectory() as folder:
            print_table([exam(Path(folder))])
    else:
        print_table([Path(name) for name in arguments])


def shorten(path: Path) -> None:
    """Leave few valve tests in a pipeline file, the first part of each, and one of them held out."""
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    recordings: Any = document["recordings"]
    kept = tomlkit.aot()
    for table in recordings:
        is_valve_test = table["experiment"] == "valve"
        if is_valve_test:
            table["to"] = "0.7 s"
        if not is_valve_test or table["name"] in VALVE_TEST_STEMS:
            kept.append(table)
    document["recordings"] = kept
    path.write_text(tomlkit.dumps(document), encoding="utf-8")


def laboratory(condition: str = "usual") -> Laboratory:
    """Return a healthy axis of the exam."""
    return prepare_case("rig", "axis", (), "", 1.0, 1, parse(condition)).laboratory


def design(rig: Laboratory) -> tuple[Controller, Model, ClosedLoopSetup]:
    """Return the controller for the exact model of a rig, the model, and the sensors that the design assumes."""
    par, sensors = rig.parameters, rig.sensors
    one_chamber = par.arrangement == ONE_CHAMBER
    requirements = Requirements(
        quantum_x=sensors.position_step, noise_p=sensors.pressure, chamber_2="closed" if one_chamber else "valve"
    )
    model = model_of(par)
    p2 = float(np.sqrt(par.ambient * par.supply)) if one_chamber else None
    setup = ClosedLoopSetup(noise_p=sensors.pressure, quantum_x=sensors.position_step)
    return design_cascade(model, requirements, p2), model, setup


def exported(out: Path, rig: Laboratory, precision: str = "float64", *, replay: bool = False) -> Path:
    """Design for a rig; write controller and C as ``pneucli export --out OUT`` does; return the folder of the C.

    The replay of a minute, which takes longest, only where it is asked for.
    """
    controller, model, setup = design(rig)
    (out / CONTROLLERS).mkdir(parents=True, exist_ok=True)
    (out / CONTROLLERS / "best.json").write_text(controller.to_json(), encoding="utf-8")
    (out / "export").mkdir(exist_ok=True)
    if replay:
        write_c(out / "export", controller, model, setup, "small", precision)
    else:
        write_c_source(out / "export", controller, "small", precision)
    return out / "export"


def write_long_recording(folder: Path, kind: str, samples: int) -> None:
    """Write a pipeline with one recording of ``samples`` rows at 1 kHz and, for an axis, a short test of its valve."""
    rng = np.random.default_rng(4)
    area = 0.0 if kind == "valve" else 8e-4
    rig = Parameters(piston_area_1=area, piston_area_2=area, overlap=0.0 if kind == "friction" else 0.15)
    bench = None if kind == "friction" else VESSEL
    laboratory = Laboratory(kind, rig, Sensors(400.0, 0.5, 0.0), vessel_volume=bench, has_cylinder=kind != "valve")
    takes = []
    if kind == "valve":
        parts = [
            valve_staircase(laboratory.valve_test_rig(), 0.5, 1.6),
            *(valve_step(laboratory.valve_test_rig(), v) for v in (1.0, 3.5, 8.0)),
        ]
        command = np.resize(np.concatenate([part.command for part in parts]), samples)
        takes = [RecordingPlan("long", "valve", "train", Excitation(command))]
    else:
        driven = closed_loop(rig, two_sine_reference(rng, samples), 150.0, 1.7e5)
        takes = [RecordingPlan("long", "axis" if kind == "axis" else "friction", "train", driven)]
    if kind == "axis":
        takes += [
            RecordingPlan(f"step_{v}", "valve", "train", valve_step(laboratory.valve_test_rig(), v))
            for v in (0.5, 1.0, 3.5, 8.0)
        ]
    laboratory.record(folder / "raw", takes, rng)
    (folder / "pipeline.toml").write_text(laboratory.pipeline(takes, "raw"))


def print_rig_tables(
    tables: Mapping[str, Callable[[argparse.Namespace], None]],
    about: str | None,
    arguments: Sequence[str],
    options: Sequence[str] = (),
) -> None:
    """Print one of a benchmark's tables of seeded rigs, or of each a small one.

    ``about`` is its help, ``options`` are its own flags.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", nargs="?", choices=list(tables))
    parser.add_argument("names", nargs="*")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seeds", type=int, default=1)
    for option in (*options, SMALL):
        parser.add_argument(option, action="store_true")
    asked = parser.parse_args(arguments)
    for name in [asked.table] if asked.table else list(tables) if asked.small else []:
        tables[name](asked)
