"""Controllers on the exam's rig, which shares no code with the model: ``python -m benchmarks.loop TABLE [NAME...]``.

TABLE is one of

- ``laws [demo | CONDITION...]``: the exported C of every law, on models that ``identify`` found;
- ``arrangements [CONDITION...]``: the exported C of ``best`` under each condition (``docs/exam.md``);
- ``precision [demo | CONDITION...]``: the C in double and in float;
- ``periods [demo | CONDITION...]``: sample times of 0.25 to 5 ms with the margins of the loops; half the mass more and
  less, and an encoder of 20 um, at 1 ms;
- ``benefit [EFFECT... | all]``: a design that does not know an effect of the rig, then one that does, from exact
  models; ``--recorded``: from identified ones; ``--unknown``: on rigs with bristles, 5 ms of lag and 0.1 V of play
  that no model knows. An axis is held with at most 50 um at rest (100 with ``--unknown``), 500 um rms, 100 um under
  the load;
- ``acceptance``: what the acceptance test of ``design`` stops, against what the C does on the rig;
- ``level``: three pressure levels of two valves, set while the C runs, against a load that jumps on;
- ``logs [EFFECT...]``: the C drives a rig that has changed by one effect; its logs are diagnosed as a user would
  (``--unknown-controller``, ``--no-accelerometer``).

Errors are in um: the largest at rest after steps of 15 % of the stroke and how far the piston moves there, rms on a
sine of 15 % at 0.5 Hz, the largest at rest under a load, and the time after which that load is rejected to 50 um. The
load is a tenth of the supply's force; of ``periods`` and ``benefit`` 50 N on 8 cm^2. ``--seeds N`` draws N rigs,
``--seed`` the first. ``benefit`` and ``periods`` run the controller's Python function, compiled with the
rig; all else needs gcc.
"""

import argparse
import ctypes
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import tomlkit

from benchmarks import rigs
from pneucli import config
from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.closed_loop.acceptance import ACCEPTANCE_SCENARIOS, acceptance_criteria
from pneucli.closed_loop.commissioning import STATES
from pneucli.closed_loop.margins import analyse_margins
from pneucli.closed_loop.metrics import evaluate_run
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, Scenario
from pneucli.controller import layout
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.design.air_spring import stiffness_per_pressure
from pneucli.design.cascade_design import design_cascade
from pneucli.design.requirements import Requirements
from pneucli.exam.cases import Case, draw_rig, generate_case, prepare_case
from pneucli.exam.conditions import Conditions, parse
from pneucli.exam.hidden_effects import BY_NAME, CATALOGUE
from pneucli.exam.laboratory import Laboratory
from pneucli.exam.rig.kernel import MAX_STEP, P1, P2, PS, T1, T2, XL, V, X, motion_sign, state_rates
from pneucli.exam.rig.parameters import ONE_CHAMBER, TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig.simulation import LOOP_PERIOD, empty_delay_line, limit_opening, step_rig
from pneucli.messages.compare import Commissioned
from pneucli.physics.effects import catalogue, select_effects
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model
from pneucli.stages.pipeline_data import load_model

ROOT = Path(__file__).parents[1]
RIGS = ("demo", "bore-12mm", "bore-25mm", "bore-50mm", "bore-100mm")
ARRANGEMENTS = (
    "usual", "5/3", "5/3-5V", "5/3-null", "two-valves", "differential+5/3", "hanging-load+5/3", "return-spring",
)  # fmt: skip
WORST_EFFECTS = (
    "none", "valve-lag", "pressure-friction", "position-friction", "friction-hysteresis", "presliding",
    "dwell-breakaway", "line-delay", "pressure-lag", "time-skew", "valve-hysteresis", "stribeck",
)  # fmt: skip
CHANGES = (
    "none", "piston-leak", "valve-lag", "stribeck", "constant-force", "extra-mass", "valve-hysteresis", "presliding",
    "friction-asymmetry", "dead-volume", "line-delay", "pressure-offset", "friction-hysteresis", "chamber-leak",
)  # fmt: skip
LEFT_OUT = ("valve-lag", "presliding", "stribeck", "piston-leak", "pressure-friction", "constant-force")
HEAD = ("at rest", "moves", "sine, rms", "under the load", "rejected, s")
USUAL = Conditions()


# The exported C on the rig.


@compiled()
def period(
    par: Parameters, first: int, steps: int, s: Array, o: Array, spools: Array, line: Array, held: int, rest: float,
    work: Array,
) -> tuple[float, float, float]:  # fmt: skip
    """Run the rig for ``steps`` steps with openings ``o`` (V): time at rest (s), air (kg), acceleration (m/s^2)."""
    air, q = 0.0, (0.0, 0.0, 0.0, 0.0)
    for i in range(first, first + steps):
        rest, q = step_rig(par, i, MAX_STEP, o[0], o[1], spools, line, s, rest, held, work)
        air += MAX_STEP * (q[0] + q[2])
    t = (first + steps) * MAX_STEP
    state_rates(par, t, s, motion_sign(par, t, s, rest), q, held, work[1])
    return rest, air, work[1][V]


class Sensed:
    """What the sensors of a rig read, a sample every ``h`` s: x, p1, p2; lag and delay of the pressures' included."""

    def __init__(self, par: Parameters, sensors: Sensors, h: float, start: Array, seed: int) -> None:
        self._par, self._sensors, self._h = par, sensors, h
        self._rng = np.random.default_rng(seed)
        self._noise, self._lagged = np.zeros(2), np.array([start[P1], start[P2]])
        self._past = [self._lagged] * (round(par.pressure_skew / h) + 1)

    def __call__(self, s: Array) -> Array:
        par, sensors = self._par, self._sensors
        share = 1.0 - np.exp(-self._h / par.pressure_lag) if par.pressure_lag > 0.0 else 1.0
        self._lagged = self._lagged + share * (np.array([s[P1], s[P2]]) - self._lagged)
        self._past = [*self._past[1:], self._lagged]
        pole = sensors.pole ** (1000.0 * self._h)
        self._noise = pole * self._noise + np.sqrt(1.0 - pole**2) * self._rng.standard_normal(2)
        shown = par.ambient + par.pressure_scale * (self._past[0] - par.ambient) + sensors.pressure * self._noise
        x = np.round(s[X] / sensors.position_step) * sensors.position_step
        return np.array([x, shown[0] + par.pressure_offset, shown[1]])


class Exported:
    """An exported controller, compiled; with a pressure level in Pa where it is given."""

    def __init__(self, folder: Path, level: float | None = None) -> None:
        library, source = folder / "controller.so", folder / "pneucli_controller.c"
        if not library.exists() or library.stat().st_mtime_ns <= source.stat().st_mtime_ns:
            subprocess.run(["gcc", "-O2", "-std=c99", "-shared", "-fPIC", source, "-o", library, "-lm"], check=True)
        code, self._state = ctypes.CDLL(str(library)), ctypes.create_string_buffer(1 << 16)
        real = ctypes.c_float if "float state" in (folder / "pneucli_controller.h").read_text() else ctypes.c_double
        self._step, self._u = code.pneucli_controller_step, (real * 2)()
        self._step.argtypes = [ctypes.c_void_p, *4 * [real], ctypes.POINTER(real)]
        self._code, self._real = code, real
        whole = ("state", "member")
        words = [(f.name, ctypes.c_int if f.name in whole else real) for f in fields(Commissioned)]
        code.pneucli_controller_commissioned.restype = type("Status", (ctypes.Structure,), {"_fields_": words})
        code.pneucli_controller_commissioned.argtypes = [ctypes.c_void_p]
        code.pneucli_controller_commission.argtypes = [ctypes.c_void_p, real, real]
        code.pneucli_controller_init(self._state)
        if level is not None:
            code.pneucli_controller_set_level.argtypes = [ctypes.c_void_p, real]
            code.pneucli_controller_set_level(self._state, level)

    def __call__(self, x_ref: float, x: float, p1: float, p2: float) -> tuple[float, float]:
        self._step(self._state, x_ref, x, p1, p2, self._u)
        return self._u[0], self._u[1]

    def enable(self, on: bool) -> None:
        """Enable the controller, or disable it."""
        self._code.pneucli_controller_enable(self._state, int(on))

    def commission(self) -> None:
        """Begin a commissioning within the limits of the design."""
        self._code.pneucli_controller_commission(self._state, 0.0, 0.0)

    def commissioned(self) -> Commissioned:
        """Return what the commissioning found."""
        found = self._code.pneucli_controller_commissioned(self._state)
        state, *others = (getattr(found, f.name) for f in fields(Commissioned))
        return Commissioned(STATES[state], *others)

    def numbers(self, count: int) -> Array:
        """Return the parameters as they are now, of which there are ``count``."""
        values = np.frombuffer(self._state.raw, self._real)
        return values[layout.L_STATES : layout.L_STATES + count]


Control = Callable[[float, float, float, float], tuple[float, float]]  # x_ref, x, p1, p2 -> commands in V


class Trace(NamedTuple):
    """What a loop did, one value a sample: true position (m), command (V), readings of x, p1, p2, a; air (kg).

    ``chambers`` has the true pressures p1, p2 (Pa), shape (n, 2).
    """

    x: Array
    u: Array
    air: float
    read: Array
    supply: Array
    a: Array
    chambers: Array


def driven(
    par: Parameters, sensors: Sensors, control: Control, reference: Array, load: Array, *, is_open: bool = False,
    h: float = LOOP_PERIOD, seed: int = 0, starved: Array | None = None,
) -> Trace:  # fmt: skip
    """Let the controller follow a ``reference`` (m) under a ``load`` (N), every ``h`` s; ``starved``: no supply."""
    s, o, work, rest = np.zeros(10), np.zeros(2), np.zeros((3, 10)), 1.0
    spools, line, steps = np.zeros(6), empty_delay_line(par, MAX_STEP), round(h / MAX_STEP)
    s[X] = s[XL] = reference[0]
    balanced = par.constant_force + par.spring_stiffness * (reference[0] - par.spring_rest)
    s[P2] = par.ambient if is_open else np.sqrt(par.ambient * par.supply)
    s[P1] = (balanced + s[P2] * par.piston_area_2) / par.piston_area_1
    s[P1] += par.ambient * (par.piston_area_1 - par.piston_area_2) / par.piston_area_1
    s[T1] = s[T2] = par.temperature
    s[PS] = par.supply
    sensed, n = Sensed(par, sensors, h, s, seed), reference.size
    x, u, supply, a, read, gas, air = *(np.zeros(n) for _ in range(4)), np.zeros((n, 3)), np.zeros((n, 2)), 0.0
    rng = np.random.default_rng([seed, 1])
    for k in range(n):
        x[k], supply[k], read[k], gas[k] = s[X], s[PS], sensed(s), (s[P1], s[P2])
        u[k], second = control(reference[k], *read[k])
        o[0] = limit_opening(par, par.command_sign * (u[k] - par.command_null))
        o[1] = limit_opening(par, second - par.command_null) if par.arrangement == TWO_VALVES else 0.0
        loaded = par._replace(constant_force=par.constant_force + load[k])
        if starved is not None:
            loaded = rigs.supplied(loaded._replace(supply=1.02 * par.ambient if starved[k] else par.supply), s)
        rest, used, moved = period(loaded, k * steps, steps, s, o, spools, line, int(is_open), rest, work)
        air += used
        a[min(k + 1, n - 1)] = moved
    return Trace(x, u, air, read, supply, a + sensors.acceleration * rng.standard_normal(n), gas)


def told(folder: Path, *command: str, pipeline: str = "pipeline.toml", out: str = "out") -> dict[str, Any]:
    """Return the answer of a command of the program to a pipeline of the folder."""
    words = [command[0], pipeline, *command[1:], "--out", out, "--json", "--quiet"]
    done = subprocess.run(
        [sys.executable, "-m", "pneucli", *words], cwd=folder, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    if done.returncode > 1:
        raise RuntimeError(" ".join(done.stderr.split())[:200])
    return dict(json.loads(done.stdout))


def exported(folder: Path, *words: str) -> Path:
    """Return the folder with the exported C of a pipeline, moved away from what another export would replace."""
    told(folder, "export", "--to", "c", *words)
    name = "".join(words).strip("-") or "c"
    return Path(shutil.copytree(folder / "out" / "export", folder / name, dirs_exist_ok=True))


def recorded_rig(name: str, folder: Path, seed: int) -> Laboratory:
    """Record a rig into ``folder``, which then holds ``pipeline.toml``."""
    if name == "demo":
        shutil.copytree(ROOT / "fixtures" / "demo", folder, dirs_exist_ok=True)
        shutil.copy(folder / "complete.toml", folder / "pipeline.toml")
        return demo_rig()
    generate_case(folder, "axis", (), "", 1.0, seed, parse(name))
    return prepare_case("rig", "axis", (), "", 1.0, seed, parse(name)).laboratory


def demo_rig() -> Laboratory:
    """Return the rig of fixtures/demo."""
    spec = importlib.util.spec_from_file_location("fixtures_make", ROOT / "fixtures" / "make.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["fixtures_make"] = module
    spec.loader.exec_module(module)
    return next(f.laboratory for f in module.fixtures() if f.laboratory.name == "demo")


def figures_of_c(rig: Laboratory, control: Path, *, is_open: bool = False) -> list[float]:
    """Return the figures of one exported controller on the rig, in the order of ``HEAD``."""
    par, time = rig.parameters, LOOP_PERIOD * np.arange(6000)
    middle, last = np.full(time.size, 0.5 * par.stroke), 500
    steps = middle + par.stroke * np.where(time < 0.5, 0.0, np.where(time < 3.0, 0.15, -0.15))
    sine = middle + 0.15 * par.stroke * np.sin(np.pi * np.maximum(time - 0.5, 0.0))
    push = 0.1 * (par.supply - par.ambient) * par.piston_area_1 * ((time >= 1.5) & (time < 4.0))
    stepped, followed, loaded = (
        1e6 * (driven(par, rig.sensors, Exported(control), r, load, is_open=is_open).x - r)
        for r, load in ((steps, 0.0 * time), (sine, 0.0 * time), (middle, push))
    )
    rests, under = [stepped[3000 - last : 3000], stepped[-last:]], loaded[4000 - last : 4000]
    return [
        max(float(np.abs(e).max()) for e in rests),
        max(float(np.ptp(e)) for e in [*rests, under]),
        float(np.sqrt(np.mean(followed[1500:] ** 2))),
        float(np.abs(under).max()),
        max(rejected(loaded[1500:4000], LOOP_PERIOD), rejected(loaded[4000:], LOOP_PERIOD)),
    ]


def rejected(error: Array, h: float) -> float:
    """Return the time in s after which an error (um) stays within 50 um; infinite: never."""
    off = np.flatnonzero(np.abs(error) > 50.0)
    return 0.0 if not off.size else np.inf if off[-1] == error.size - 1 else h * float(off[-1] + 1)


def head(*names: str) -> None:
    """Print the first lines of a table."""
    print(f"| {' | '.join(names)} |\n|{' --- |' * len(names)}", flush=True)


def row(*cells: object) -> None:
    """Print a row of a table."""
    print(f"| {' | '.join(f'{c:.3g}' if isinstance(c, float) else str(c) for c in cells)} |", flush=True)


def print_laws(asked: argparse.Namespace) -> None:
    """Print a row for each rig and control law, then the worst of each law."""
    head("rig", "law", *HEAD)
    found: dict[str, list[list[float]]] = {}
    for name in ["usual"] if asked.small else asked.names or RIGS:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            rig = rigs.laboratory() if asked.small else recorded_rig(name, folder, asked.seed)
            for law in ["best"] if asked.small else LAWS:
                try:
                    control = rigs.exported(folder, rig) if asked.small else exported(folder, "--controller", law)
                except RuntimeError as error:
                    row(name, law, error)
                    continue
                found.setdefault(law, []).append(figures_of_c(rig, control))
                row(name, law, *found[law][-1])
    for law, those in found.items():
        row("worst", law, *(float(x) for x in np.max(those, axis=0)))


def print_arrangements(asked: argparse.Namespace) -> None:
    """Print a row for each condition."""
    head("condition", *HEAD)
    for name in ["usual"] if asked.small else asked.names or ARRANGEMENTS:
        conditions = parse(name)
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            rig = rigs.laboratory(name) if asked.small else recorded_rig(name, folder, asked.seed)
            control = rigs.exported(folder, rig) if asked.small else exported(folder)
            is_open = conditions.load == "spring" and conditions.valve is None
            row(name, *figures_of_c(rig, control, is_open=is_open))


def print_precision(asked: argparse.Namespace) -> None:
    """Print a row for each rig and precision."""
    head("rig", "precision", *HEAD)
    for name in ["usual"] if asked.small else asked.names or RIGS:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            rig = rigs.laboratory() if asked.small else recorded_rig(name, folder, asked.seed)
            for precision in ("float64", "float32"):
                if asked.small:
                    control = rigs.exported(folder / precision, rig, precision)
                else:
                    control = exported(folder, "--precision", precision)
                row(name, precision, *figures_of_c(rig, control))


def print_levels(asked: argparse.Namespace) -> None:
    """Print a row for each rig with two valves and pressure level."""
    head("rig", "level asked, bar", "kept, bar", "gas, N/mm", "deviation", "at rest", "under load", "air, g")
    for seed in range(asked.seed, asked.seed + asked.seeds):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            rig = rigs.laboratory("two-valves") if asked.small else recorded_rig("two-valves", folder, seed)
            control = rigs.exported(folder / "out", rig) if asked.small else exported(folder)
            values = controller_of(folder / "out", "best").values
            for share in (0.25,) if asked.small else (0.25, 0.5, 0.75):
                row(seed, *level_figures(rig, values, control, share))


def level_figures(rig: Laboratory, values: Mapping[str, float], control: Path, share: float) -> list[float]:
    """Return the figures of one pressure level, a share of the way from ambient to supply pressure."""
    par, time, on, last = rig.parameters, LOOP_PERIOD * np.arange(6000), 3000, 500
    still, level = np.full(time.size, 0.5 * par.stroke), par.ambient + share * (par.supply - par.ambient)
    push = 0.1 * (par.supply - par.ambient) * par.piston_area_1 * (time >= LOOP_PERIOD * on)
    trace = driven(par, rig.sensors, Exported(control, level), still, push)
    error = 1e6 * np.abs(trace.x - still)
    p1, p2 = trace.read[on - last : on, 1:].mean(axis=0)
    one, two = stiffness_per_pressure(values, np.array(0.5 * par.stroke))
    rests = (error[on:].max(), error[on - last : on].max(), error[-last:].max(), 1e3 * trace.air)
    return [float(v) for v in (1e-5 * level, 5e-6 * (p1 + p2), 1e-3 * (one * p1 + two * p2), *rests)]


def controller_of(out: Path, law: str) -> Controller:
    """Return a controller that ``design`` wrote."""
    return Controller.from_json((out / rigs.CONTROLLERS / f"{law}.json").read_text(encoding="utf-8"))


# The acceptance test.


@dataclass(frozen=True)
class Variant:
    """How a model comes about: hidden and known effects, tables of the pipeline file, and a payload that came later."""

    title: str
    hidden: tuple[str, ...] = ()
    known: tuple[str, ...] = ()
    tables: tuple[tuple[str, Any], ...] = ()
    payload: float = 0.0


def variants() -> list[Variant]:
    return [
        Variant("good"),
        *(Variant("good", (e,), (e,)) for e in LEFT_OUT),
        *(Variant("effect left out", (e,)) for e in LEFT_OUT),
        Variant("far from its data", tables=(("parameters", {"friction.coulomb": {"fixed": "80 N"}}),)),
        Variant("payload +50 %", payload=0.5),
        Variant("payload -50 %", payload=-0.5),
        Variant("5 ms", tables=(("design", {"period": "5 ms"}),)),
    ]


def print_acceptance(asked: argparse.Namespace) -> None:
    """Print a row for each model, then the counts by kind of model."""
    head("model", "hidden", "rig", "acceptance", "model's error", "on the rig", "at rest", "moves")
    if asked.small:
        rig = rigs.laboratory()
        wanted = Requirements(quantum_x=rig.sensors.position_step, noise_p=rig.sensors.pressure)
        with tempfile.TemporaryDirectory() as place:
            held, found = on_the_rig(Path(place), rigs.exported(Path(place), rig), rig.parameters, rig, wanted, 1)
        row("exact", "", 1, "", "", "holds" if held else "fails", *found)
        return
    counts: Counter[tuple[str, bool, bool]] = Counter()
    for seed in range(asked.seed, asked.seed + asked.seeds):
        for one in variants():
            try:
                stopped, error, held, found = judged(one, seed)
            except RuntimeError as failure:
                row(one.title, ", ".join(one.hidden), seed, failure)
                continue
            counts[one.title, stopped, held] += 1
            words = ("stops" if stopped else "passes", error, "holds" if held else "fails")
            row(one.title, ", ".join(one.hidden), seed, *words, *found)
    print()
    head("model", "stops what fails", "stops what holds", "passes what holds", "passes what fails")
    for title in dict.fromkeys(v.title for v in variants()):
        row(title, *(counts[title, s, h] for s, h in ((True, False), (True, True), (False, True), (False, False))))


def judged(variant: Variant, seed: int) -> tuple[bool, float, bool, list[float]]:
    """Return whether a design is stopped, the model's error over its noise, whether the rig holds, and figures."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        generate_case(folder, "axis", variant.hidden, "", 1.0, seed, USUAL)
        rig = prepare_case("rig", "axis", variant.hidden, "", 1.0, seed, USUAL).laboratory
        change(folder / "pipeline.toml", variant.known, dict(variant.tables))
        answer = told(folder, "design", "--compare", "best")
        control = exported(folder)
        par = rig.parameters._replace(mass=rig.parameters.mass * (1.0 + variant.payload))
        gate, wanted = answer["gate"], Requirements(**answer["requirements"])
        held, found = on_the_rig(folder / "out", control, par, rig, wanted)
        return not gate["passed"], float(gate["model_error"]), held, found


def change(path: Path, known: Sequence[str], tables: Mapping[str, Any]) -> None:
    """Write known effects and tables into a pipeline file; ``parameters`` is one of ``[model]``."""
    document: Any = tomlkit.parse(path.read_text(encoding="utf-8"))
    model = document.setdefault("model", tomlkit.table())
    model["effects"] = sorted({*model.get("effects", []), *known})
    for name, table in tables.items():
        (model if name == "parameters" else document)[name] = table
    path.write_text(tomlkit.dumps(document), encoding="utf-8")


def on_the_rig(
    out: Path, control: Path, par: Parameters, rig: Laboratory, wanted: Requirements, noises: int = 3
) -> tuple[bool, list[float]]:
    """Return whether the exported C keeps on the rig what is required, the error at rest and the cycle."""
    controller, found = controller_of(out, wanted.controller), []
    for scenario in read_scenarios([], controller, ""):
        for seed in range(noises) if scenario.name in ACCEPTANCE_SCENARIOS else ():
            asked = (par, rig.sensors, Exported(control), scenario.reference, -scenario.force)
            trace = driven(*asked, h=controller.period, seed=seed)
            with np.errstate(invalid="ignore"):
                found.append(evaluate_run(as_run(scenario, controller, trace), MODEL, controller))
    missed = [d.is_violated(d.figure(m)) for d in acceptance_criteria(wanted, controller) for m in found]
    figures = [float(np.nanmax([getattr(m, n) for m in found])) for n in ("steady_um", "cycle_um")]
    return not any(missed), figures


MODEL = Model(Rig(gas_temperature=293.15, ambient_pressure=1.013e5))  # of which the figures of air are told, not used


def as_run(scenario: Scenario, controller: Controller, trace: Trace) -> Run:
    """Return what the rig did in the form of a simulated run."""
    out, rows = np.full((trace.x.size, at.OUTPUTS), np.nan), np.zeros((trace.x.size, layout.L_ROW))
    out[:, at.X], rows[:, layout.L_U1] = trace.x, trace.u
    return Run(scenario, controller.period * np.arange(trace.x.size), out, rows)


# The compiled loop: sample times, and the benefit of knowing an effect.


def design(model: Model, par: Parameters, h: float, quantum: float = 1e-6, noise: float = 400.0) -> Controller:
    """Return the controller for a model of the rig."""
    closed = par.arrangement == ONE_CHAMBER
    wanted = Requirements(period=h, quantum_x=quantum, noise_p=noise, chamber_2="closed" if closed else "valve")
    return design_cascade(model, wanted, float(np.sqrt(par.ambient * par.supply)) if closed else None)


@dataclass(frozen=True)
class BenefitRuns:
    """Steps, a sine, and a load that comes and goes: errors (um) and commands (V), a value each ``period`` (s)."""

    errors: tuple[Array, Array, Array]
    commands: tuple[Array, Array, Array]
    period: float

    def rests(self, values: tuple[Array, Array, Array]) -> list[Array]:
        """Return the last 0.5 s after each step, before the load goes, and after it, of ``values`` of each run."""
        (stepped, _, loaded), last = values, round(0.5 / self.period)
        ends = [(stepped, 3.5), (stepped, 6.5), (loaded, 4.0), (loaded, 6.5)]
        return [run[round(end / self.period) - last : round(end / self.period)] for run, end in ends]

    def figures(self) -> list[float]:
        """Return the figures in the order of ``HEAD``."""
        _, followed, loaded = self.errors
        largest = [float(np.abs(e).max()) for e in self.rests(self.errors)]
        return [
            max(largest[:2]),
            max(float(np.ptp(e)) for e in self.rests(self.errors)),
            float(np.sqrt(np.mean(followed[round(1.5 / self.period) :] ** 2))),
            max(largest[2:]),
            rejected(loaded[round(1.0 / self.period) : round(4.0 / self.period)], self.period),
        ]


def benefit_runs(
    par: Parameters, c: Controller, quantum: float = 1e-6, noise: float = 400.0, commissioning: float = 0.0
) -> BenefitRuns:
    """Return the runs of one controller on one rig, each after ``commissioning`` (s) if any."""
    h = c.period
    time = h * np.arange(round(6.5 / h))
    middle = np.full(time.size, 0.5 * par.stroke)
    steps = middle + par.stroke * np.where(time < 0.5, 0.0, np.where(time < 3.5, 0.15, -0.15))
    sine = middle + 0.15 * par.stroke * np.sin(np.pi * np.maximum(time - 0.5, 0.0))
    push = 50.0 * par.piston_area_1 / 8e-4 * ((time >= 1.0) & (time < 4.0))
    first = round(commissioning / h)
    mode = np.zeros(first + time.size)
    mode[round(0.2 / h)] = layout.OPERATING_MODES.index("commission") * (first > 0)
    errors, commands = [], []
    for reference, load in ((steps, 0.0 * time), (sine, 0.0 * time), (middle, push)):
        whole, loads = (np.concatenate([np.full(first, part[0]), part]) for part in (reference, load))
        trace = rigs.driven(par, c, whole, loads, noise, quantum, mode=mode, keeps_states=False)
        errors.append(1e6 * (trace.x[first:] - reference))
        commands.append(trace.u[first:])
    return BenefitRuns((errors[0], errors[1], errors[2]), (commands[0], commands[1], commands[2]), h)


def print_periods(asked: argparse.Namespace) -> None:
    """Print the rows of each rig: designed for the identified model, driven on the rig."""
    head("rig", "what", *HEAD, "gain margin", "phase, deg", "delay, ms")
    for name in ["usual"] if asked.small else asked.names or RIGS:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            rig = rigs.laboratory() if asked.small else recorded_rig(name, folder, asked.seed)
            model = rigs.model_of(rig.parameters) if asked.small else identified(folder)
        par, x = rig.parameters, rig.sensors.position_step
        cases = [(f"{1e3 * h:g} ms", par, h, x) for h in ((1e-3,) if asked.small else (0.25e-3, 1e-3, 2e-3, 5e-3))]
        if not asked.small:
            cases += [(f"mass x {share:g}", par._replace(mass=share * par.mass), 1e-3, x) for share in (0.5, 1.5)]
            cases += [("encoder of 20 um", par, 1e-3, 20e-6)]
        for what, actual, h, quantum in cases:
            controller = design(model, par, h, quantum, rig.sensors.pressure)
            found = benefit_runs(actual, controller, quantum, rig.sensors.pressure).figures()
            setup = ClosedLoopSetup(quantum_x=quantum, noise_p=rig.sensors.pressure)
            corner = float(controller.values["C_KI"] ** (1.0 / 3.0))  # rad/s, of the position loop
            margins = [cut.margins for cut in analyse_margins(model, controller, setup, corner).cuts]
            gain, phase, delay = (
                min((getattr(m, n) for m in margins), default=np.nan) for n in ("gain_up", "phase", "delay")
            )
            row(name, what, *found, float(gain), float(np.degrees(phase)), 1e3 * float(delay))


def print_benefit(asked: argparse.Namespace) -> None:
    """Print medians over the rigs without / with the effect known, and how many axes are held."""
    names = ["none"] if asked.small else asked.names or list(WORST_EFFECTS)
    if names == ["all"]:
        names = ["none", *(e.name for e in CATALOGUE if "axis" in e.kinds or "friction" in e.kinds)]
    total = np.zeros(3, dtype=int)
    head("effect", *HEAD, "held")
    for name in names:
        rows: list[list[list[float]]] = [[], []]
        for seed in range(asked.seed, asked.seed + asked.seeds):
            par, *models = (recorded_models if asked.recorded else exact_models)(seed, name)
            actual = with_unknowns(par) if asked.unknown else par
            for found, model in zip(rows, models, strict=True):
                try:
                    found.append(benefit_runs(actual, design(model, par, 1e-3)).figures())
                except Exception as error:  # a design that is impossible, or a loop that diverges, is not held
                    print(name, repr(error)[:200], file=sys.stderr)
                    found.append([np.inf] * len(HEAD))
        held = [sum(is_held(f, unknown=asked.unknown) for f in found) for found in rows]
        total += [*held, asked.seeds]
        pairs = zip(*(np.median(found, axis=0) for found in rows), strict=True)
        row(name, *(f"{before:.3g} / {after:.3g}" for before, after in pairs), f"{held[0]} / {held[1]}")
    print(f"held: {total[0]} without, {total[1]} with the effect known, of {total[2]}")


def is_held(found: Sequence[float], *, unknown: bool) -> bool:
    """Whether an axis is held."""
    return bool(found[0] <= (100.0 if unknown else 50.0) and found[2] <= 500.0 and found[3] <= 100.0)


def with_unknowns(par: Parameters) -> Parameters:
    """Return a rig with what any has: bristles, a slow spool and play.

    No bristles where an effect would vanish with them: the rig's have neither two branches nor a memory of rest.
    """
    stiffness = 4e4 * par.piston_area_1 / 8e-4
    known = par.drop > 0.0 or par.dwell_gain > 0.0 or par.bristle_stiffness > 0.0
    more = {} if known else {"bristle_stiffness": stiffness, "bristle_damping": 2e-3 * stiffness}
    return par._replace(valve_lag=max(par.valve_lag, 5e-3), valve_half_width=max(par.valve_half_width, 0.1), **more)


def exact_models(seed: int, name: str) -> tuple[Parameters, Model, Model]:
    """Return a rig with one effect at its full size, the model that does not know it, and the one that does."""
    rng = np.random.default_rng(seed)
    par = draw_rig("axis", False, rng)
    par = par if name == "none" else BY_NAME[name].apply(par, 1.0, rng)
    return par, rigs.model_of(par), rigs.model_of(par, () if name == "none" else (name,))


def recorded_models(seed: int, name: str) -> tuple[Parameters, Model, Model]:
    """Return the same with both models identified from the rig's recordings, by the program's own command."""
    hidden = () if name == "none" else (name,)
    par = prepare_case("rig", "axis", hidden, "", 1.0, seed, USUAL).laboratory.parameters
    models = []
    for known in ((), hidden) if hidden else ((),):
        with tempfile.TemporaryDirectory() as place:
            generate_case(Path(place), "axis", hidden, "", 1.0, seed)
            change(Path(place) / "pipeline.toml", known, {})
            models.append(identified(Path(place)))
    return par, models[0], models[-1]


def identified(folder: Path) -> Model:
    """Return the model that ``pneucli identify`` finds for a folder's pipeline."""
    told(folder, "identify")
    settings = config.load(folder / "pipeline.toml")
    return load_model(folder / "out/identify", settings.to_rig(), select_effects(settings.model.effects, catalogue()))


# Logs of a running controller.


def print_logs(asked: argparse.Namespace) -> None:
    """Print a row for each rig and effect by which it has changed."""
    head("effect", "rig", "verdict", "named", "right", "error, train / test", "foretold; measured", "u over its noise")
    for seed in range(asked.seed, asked.seed + asked.seeds):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            generate_case(folder, "axis", (), "", 1.0, seed, USUAL)
            case = prepare_case("rig", "axis", (), "", 1.0, seed, USUAL)
            if asked.small:
                rigs.shorten(folder / "pipeline.toml")
                write_logs(folder, rigs.exported(folder / "out", case.laboratory), case, case.laboratory.parameters,
                           asked, ["test"])  # fmt: skip
                answer = told(folder, "ingest", pipeline="logs.toml", out="of-logs")
                row("none", seed, "read", len(answer["recordings"]), "", "", "", "")
                continue
            control = exported(folder)
            for name in asked.names or CHANGES:
                par = case.laboratory.parameters
                if name != "none":
                    par = BY_NAME[name].apply(par, 1.0, np.random.default_rng([seed, 7]))
                write_logs(folder, control, case, par, asked, ["train", "train", "test"])
                row(name, seed, *log_cells(folder, name))


def log_cells(folder: Path, name: str) -> list[str]:
    """Return the cells of one effect: what ``diagnose`` and ``compare`` answer to the logs."""
    found, compared = (told(folder, stage, pipeline="logs.toml", out="of-logs") for stage in ("diagnose", "compare"))
    named = [(c["effect"], c["indistinguishable_from"]) for c in found["candidates"] if c["effect"] in found["missing"]]
    is_right = found["verdict"] == ("adequate" if name == "none" else "missing-effect")
    is_right &= name == "none" or any(name in (effect, *equals) for effect, equals in named)
    ratios = [c["ratio_to_noise"] for c in compared["channels"] if c["channel"] == "u"]
    loops = [
        f"{log[kind]['steady_um'] or 0:.3g} and {log[kind]['tracking_rms_um'] or 0:.3g}"
        for log in compared.get("closed_loop", ())
        for kind in ("foretold", "measured")
        if log["use"] == "test"
    ]
    shown = ", ".join(f"{e} ({'/'.join(equals)})" if equals else e for e, equals in named)
    errors = " / ".join(f"{compared['error'][use]:.2f}" for use in ("train", "test"))
    return [found["verdict"], shown, str(is_right), errors, "; ".join(loops), f"{max(ratios):.2f}" if ratios else "–"]


def write_logs(
    folder: Path, export: Path, case: Case, par: Parameters, asked: argparse.Namespace, uses: Sequence[str]
) -> None:
    """Let the exported controller drive the rig; write its logs and the pipeline that reads them, ``logs.toml``."""
    document: Any = tomlkit.parse((folder / "pipeline.toml").read_text(encoding="utf-8"))
    recordings = tomlkit.aot()
    for table in document["recordings"]:
        if table["experiment"] == "valve":
            recordings.append(table)
    for i, use in enumerate(uses):
        reference = moves(par, i)
        trace = driven(par, case.laboratory.sensors, Exported(export), reference, 0.0 * reference, seed=i)
        columns(trace, reference, par).to_csv(folder / "raw" / f"log_{i}.csv", index=False)
        about = {"name": f"log_{i}", "file": f"raw/log_{i}.csv", "experiment": "closed-loop", "use": use}
        is_unknown = asked.unknown_controller or asked.small  # a small run has no controller's file
        ran = "unknown" if is_unknown else str(export / "pneucli_controller.json")
        recordings.append(tomlkit.item(about | {"controller": ran, "chamber_2": "closed"}))
    document["recordings"] = recordings
    document["signals"]["x_ref"] = {"column": "X_ref [mm]", "unit": "mm"}
    for signal, is_there in (("p_supply", case.laboratory.supply_recorded), ("a", not asked.no_accelerometer)):
        if not is_there:
            document["signals"].pop(signal, None)
    (folder / "logs.toml").write_text(tomlkit.dumps(document), encoding="utf-8")


def moves(par: Parameters, i: int) -> Array:
    """Return what a log of 12 s asks for in m: way points, then a sine."""
    rng, time = np.random.default_rng([i, 3]), LOOP_PERIOD * np.arange(round(12.0 / LOOP_PERIOD))
    points = np.concatenate([[0.5], rng.uniform(0.3, 0.7, 3)])
    reference = points[np.minimum((time / 2.0).astype(int), 3)]
    sine = points[3] + rng.uniform(0.05, 0.12) * np.sin(2 * np.pi * rng.uniform(0.3, 0.8) * (time - 8.0))
    return np.asarray(par.stroke * np.where(time < 8.0, reference, sine))


def columns(trace: Trace, reference: Array, par: Parameters) -> pd.DataFrame:
    """Return a log as the machine's program writes it: what the controller read and what it commanded."""
    gauge = 1e-5 * (trace.read[:, 1:] - par.ambient)
    return pd.DataFrame(
        {
            "t [ms]": 1e3 * LOOP_PERIOD * np.arange(reference.size),
            "X_ref [mm]": np.round(1e3 * reference, 6),
            "U_valve [V]": np.round(trace.u, 6),
            "P_supply [bar]": np.round(1e-5 * (trace.supply - par.ambient), 5),
            "P1 [bar]": np.round(gauge[:, 0], 5),
            "P2 [bar]": np.round(gauge[:, 1], 5),
            "Pos [mm]": np.round(1e3 * trace.read[:, 0], 6),
            "Acc [m/s2]": np.round(trace.a, 5),
        }
    )


TABLES = {
    "laws": print_laws,
    "arrangements": print_arrangements,
    "precision": print_precision,
    "periods": print_periods,
    "benefit": print_benefit,
    "acceptance": print_acceptance,
    "level": print_levels,
    "logs": print_logs,
}


def main(arguments: list[str]) -> None:
    """Print one of the tables, or of each a small one."""
    rigs.print_rig_tables(
        TABLES, __doc__, arguments, ("--recorded", "--unknown", "--unknown-controller", "--no-accelerometer")
    )


if __name__ == "__main__":
    main(sys.argv[1:])
