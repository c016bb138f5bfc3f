"""Friction and control laws of the thesis, on rigs of their own: ``python -m benchmarks.thesis friction|laws``.

``friction [SEED]``: a bench that shares no code with the program: friction on two branches (3.6 while speeding up,
Coulomb and viscous while slowing, 3.7 and 6.21; between them the speed stays), stepped by 10 us. A piston of 2.2 kg
follows sines and rests, driven by a measured force (drops of 0, 0.2 and 0.4, and a viscous constant of its own while
slowing; the pipeline's model has Stribeck friction alone). Then the bench of the thesis: a small flow fills chamber 1,
chamber 2 is open, the piston slips one way; recorded are p1 with a, with x and a, or with v. Prints what ``diagnose``
names with its parameters and intervals, and models A and D of ``identify``.

``laws [RIG...]``: all laws and their variants, from the exact model of a rig of the exam (fixtures/demo, and four
with Stribeck friction), drive that rig, which shares no code with the model. Columns: largest error over the last
half second at rest after steps of 15 % of the stroke; largest motion at rest after steps and under a load; rms error
of a sine of 0.5 Hz (15 % of the stroke, or what the reference's largest speed allows); largest error at rest under 50
N (scaled by the area over 8 cm^2) and the time to reject it to 50 um; error of the load estimate over the load; the
least share of samples in sliding of the load and the flow observer. The last rows are the worst of all rigs.
"""

import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow.parquet as pq

from benchmarks import rigs
from benchmarks.loop import demo_rig, rejected
from benchmarks.rigs import Trace, driven, model_of
from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.closed_loop.metrics import OBSERVERS, ROUNDING
from pneucli.controller import layout
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.design.bandwidths import choose_bandwidths
from pneucli.design.cascade_design import design_cascade
from pneucli.design.control_laws import (
    DesignData,
    collect_design_data,
    design_controllers,
    design_variants,
    sliding_surfaces,
)
from pneucli.design.pdc import compare_weight_types
from pneucli.design.requirements import Requirements
from pneucli.design.sliding import axis_systems
from pneucli.exam.cases import prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.rig.parameters import ONE_CHAMBER, Parameters
from pneucli.tp import WeightType

STEP, EVERY = 1e-5, 100  # s; of which one is recorded
AMBIENT, GAS, KAPPA = 101_300.0, 287.0 * 293.15, 1.4
RUNS = 4
RIGS = ("demo", "usual", "two-valves", "differential+5/3", "bore-12mm")
SEED, SMALL_RIG = 1, "small"
STRIBECK_SIZE = 0.4  # of the catalogue's typical size
PERIOD, DURATION, REST = 1e-3, 6.5, 500  # s, s, samples
STATES = {"load": layout.S_LOAD, "flow": layout.S_FLOW1}
HEAD = ("rig", "law", "rest, um", "cycle, um", "sine, um", "load, um", "rejected, s", "load estimate off", "sliding")


class Friction(NamedTuple):
    """Friction of the bench and the mass that it brakes."""

    mass: float = 2.2
    coulomb: float = 14.0
    static: float = 22.0
    velocity: float = 0.015
    viscous: float = 45.0
    drop: float = 0.0
    viscous_drop: float = 0.0


BENCH = Friction(0.15, 2.0, 3.7, 0.019, 15.0)
AREA, DEAD_VOLUME = 4.91e-4, 30e-6


@compiled()
def acceleration(f: Friction, v: float, push: float) -> float:
    """Acceleration in m/s^2 under all forces but friction (N)."""
    way = math.copysign(1.0, v if v else push)
    if v == 0.0:
        return way * max(abs(push) - f.static, 0.0) / f.mass
    speed, drive = abs(v), way * push
    rising = f.coulomb + (f.static - f.coulomb) / (1.0 + (speed / f.velocity) ** 2) + f.viscous * speed
    slowing = min(f.coulomb * (1.0 - f.drop) + f.viscous * (1.0 - f.viscous_drop) * speed, rising)
    return way * (max(drive - rising, 0.0) + min(drive - slowing, 0.0)) / f.mass


@compiled()
def moved(x: float, v: float, a: float) -> tuple[float, float]:
    """Position in m and speed in m/s after a step; a piston that turns stops first."""
    after = v + STEP * a
    after = 0.0 if v * after < 0.0 else after
    return x + 0.5 * STEP * (v + after), after


@compiled()
def pulled(f: Friction, reference: Array, rate: Array) -> Array:
    """Columns force (N), x (m), v (m/s), a (m/s^2) of a piston that a spring and a damper pull after a reference."""
    x, v, out = reference[0], 0.0, np.zeros((reference.size, 4))
    for k in range(EVERY * (reference.size - 1) + 1):
        i = k // EVERY
        later, share = min(i + 1, reference.size - 1), k / EVERY - i
        at = reference[i] + share * (reference[later] - reference[i])
        push = f.mass * (3600.0 * (at - x) + 55.0 * (rate[i] - v))
        a = acceleration(f, v, push)
        if k % EVERY == 0:
            out[i] = push, x, v, a
        x, v = moved(x, v, a)
    return out


@compiled()
def filled(f: Friction, flow: float, samples: int) -> Array:
    """Columns p1 (Pa), x, v, a of a piston whose chamber a flow (kg/s) fills."""
    x, v, p, out = 0.01, 0.0, AMBIENT, np.zeros((samples, 4))
    for k in range(EVERY * (samples - 1) + 1):
        a, before = acceleration(f, v, AREA * (p - AMBIENT)), x
        if k % EVERY == 0:
            out[k // EVERY] = p, x, v, a
        x, v = moved(x, v, a)
        p += KAPPA * (GAS * flow * STEP - p * AREA * (x - before)) / (DEAD_VOLUME + AREA * x)
    return out


def write(folder: Path, runs: list[Array], noise: tuple[float, float, float, float], rng: np.random.Generator) -> None:
    """Write the recordings; ``noise`` of the four columns in SI."""
    for number, run in enumerate(runs, 1):
        read = run + rng.normal(size=run.shape) * noise
        table = np.column_stack([1e-3 * np.arange(len(read)), read])
        np.savetxt(folder / f"run_{number}.csv", table, "%.9g", ",", header="t,drive,x,v,a", comments="")


def pipeline(folder: Path, f: Friction, drive: str, signals: str, effects: str) -> Path:
    """Write a pipeline file that reads some of the columns."""
    units = {"x": "m", "v": "m/s", "a": "m/s^2"}
    lines = [f'{name} = {{ column = "{name}", unit = "{units[name]}" }}' for name in signals]
    unit = "Pa" if drive == "p1" else "N"
    text = f"""[pipeline]
name = "thesis-friction"
[rig]
ambient_pressure = {AMBIENT}
[rig.cylinder]
piston_area_1 = {AREA}
piston_area_2 = "4.12 cm^2"
stroke = "1 m"
moving_mass = {f.mass}
[signals]
time = {{ column = "t", unit = "s" }}
{drive} = {{ column = "drive", unit = "{unit}" }}
{chr(10).join(lines)}
[[recordings]]
file = "run_*.csv"
experiment = "friction"
use = "train"
test = "run_{RUNS}.csv"
chamber_2 = "open"
[identify.friction]
velocity_range = "50 mm/s"
[model]
effects = [{effects}]
"""
    path = folder / f"{drive}-{signals}.toml"
    path.write_text(text, encoding="utf-8")
    return path


def answer(stage: str, path: Path) -> dict[str, Any]:
    """Return the JSON answer of a stage."""
    command = [
        sys.executable,
        "-m",
        "pneucli",
        stage,
        str(path),
        "--json",
        "--quiet",
        "--out",
        str(path.with_suffix("")),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return json.loads(done.stdout) if done.returncode == 0 else {"verdict": done.stderr.strip()[-200:]}


def named(path: Path) -> str:
    """What ``diagnose`` names, with parameters and intervals, and the errors before and after."""
    found = answer("diagnose", path)
    lines = [f"{found['verdict']}: {', '.join(found.get('missing', [])) or 'nothing'}"]
    for candidate in found.get("candidates", []):
        if candidate["effect"] in found["missing"]:
            told = [f"{n} {_interval(p['value'], *p['ci95'])}" for n, p in candidate["parameters"].items()]
            lines.append(f"{candidate['effect']} ({candidate['confidence']:.3f}): {', '.join(told)}")
    errors = [f"{rung['error_test']:.3g}" for rung in found.get("ladder", [])]
    return "; ".join(lines) + f"; errors {' -> '.join(errors)}"


def _interval(value: float, low: float, high: float) -> str:
    return f"{value:.4g} [{low:.4g}, {high:.4g}]"


def models(path: Path) -> str:
    """Parameters of models A and D by ``identify``."""
    answer("identify", path)
    file = path.with_suffix("") / "identify" / "friction_parameters.parquet"
    rows = pq.read_table(file).to_pylist() if file.exists() else []
    return "; ".join(
        f"{r['model']} {r['branch']} {r['name']} {_interval(r['value'], r['ci_low'], r['ci_high'])}" for r in rows
    )


def reference(rng: np.random.Generator) -> tuple[Array, Array]:
    """A reference in m and its rate in m/s: sines, with rests."""
    time = 1e-3 * np.arange(6001)
    rate = np.zeros(time.size)
    for frequency, size in zip(rng.uniform(0.3, 1.2, 4), rng.uniform(0.01, 0.03, 4), strict=True):
        rate += 2.0 * np.pi * frequency * size * np.cos(2.0 * np.pi * frequency * time + rng.uniform(0.0, 6.3))
    rate *= np.sin(2.0 * np.pi * rng.uniform(0.15, 0.4) * time) > -0.6
    return 0.5 + 1e-3 * np.cumsum(rate), rate


def print_small_friction() -> None:
    """Write one rig without hysteresis and ingest its recordings."""
    rng, f = np.random.default_rng(1), Friction()
    with tempfile.TemporaryDirectory() as name:
        write(Path(name), [pulled(f, *reference(rng)) for _ in range(RUNS)], (0.1, 1e-6, 1e-4, 0.04), rng)
        found = answer("ingest", pipeline(Path(name), f, "force", "xa", '"stribeck"'))
    print(f"{len(found['recordings'])} recordings")


def print_friction(seed: int) -> None:
    """Print the answers and the models of each rig."""
    with tempfile.TemporaryDirectory() as name:
        for drop, viscous_drop in ((0.0, 0.0), (0.2, 0.0), (0.4, 0.0), (0.1, 0.4)):
            rng, f = np.random.default_rng(seed), Friction(drop=drop, viscous_drop=viscous_drop)
            folder = Path(name, f"{drop}-{viscous_drop}")
            folder.mkdir()
            write(folder, [pulled(f, *reference(rng)) for _ in range(RUNS)], (0.1, 1e-6, 1e-4, 0.04), rng)
            path = pipeline(folder, f, "force", "xa", '"stribeck"')
            print(f"drop {drop}, viscous {viscous_drop}: {named(path)}")
        rng, folder = np.random.default_rng(seed), Path(name, "stick-slip")
        folder.mkdir()
        runs = [filled(BENCH, 2.2e-6 * rng.uniform(0.5, 1.6), 12_001) for _ in range(RUNS)]
        write(folder, runs, (25.0, 5e-7, 5e-5, 0.03), rng)
        for signals in ("a", "xa", "v"):
            path = pipeline(folder, BENCH, "p1", signals, "")
            print(f"p1 and {signals}: {models(path)}")
            print(f"p1 and {signals}: {named(path)}")


def rig(name: str) -> Parameters:
    """Return the parameters of a rig by its condition, or those of fixtures/demo or of small runs."""
    if name == SMALL_RIG:
        return rigs.laboratory().parameters
    if name == "demo":
        return demo_rig().parameters
    return prepare_case("rig", "axis", ("stribeck",), "", STRIBECK_SIZE, SEED, parse(name)).laboratory.parameters


@cache
def design_data(par: Parameters, weight_types: tuple[WeightType, ...] = ("cno",)) -> DesignData:
    """Return the design data of a rig from its exact model; without a type of weights there is no PDC."""
    model = model_of(par, ("stribeck", *(("piston-leak",) if par.piston_leak_area > 0.0 else ())))
    closed = par.arrangement == ONE_CHAMBER
    wanted = Requirements(quantum_x=1e-6, noise_p=400.0, chamber_2="closed" if closed else "valve")
    cascade = design_cascade(model, wanted, float(np.sqrt(par.ambient * par.supply)) if closed else None)
    c = cascade.values
    bandwidths = choose_bandwidths(model, wanted, c, predicted=False)
    mechanical = axis_systems(c, 0.5 * c["C_STROKE"], c["C_P_MEAN"], c["C_P_MEAN"])["mechanical"]
    surfaces = sliding_surfaces(mechanical, bandwidths, wanted)
    return collect_design_data(cascade, bandwidths, wanted, surfaces, compare_weight_types(c, 0.05, weight_types), {})


def controllers(data: DesignData) -> Iterator[tuple[str, Controller]]:
    """Yield the controllers by title: all laws and their variants."""
    yield from design_controllers(data)[0].items()
    yield from design_variants(data, LAWS).items()


def figures(par: Parameters, controller: Controller) -> list[float]:
    """Return the figures of one controller on one rig, in the order of ``HEAD``."""
    time, middle = PERIOD * np.arange(round(DURATION / PERIOD)), 0.5 * par.stroke
    amplitude = min(0.15 * par.stroke, controller.values["C_V_MAX"] / np.pi)
    steps = middle + par.stroke * np.where(time < 0.5, 0.0, np.where(time < 3.5, 0.15, -0.15))
    sine = middle + amplitude * np.sin(np.pi * np.maximum(time - 0.5, 0.0))
    load = 50.0 * par.piston_area_1 / 8e-4 * ((time >= 1.0) & (time < 4.0))
    still, nothing = np.full(time.size, middle), np.zeros(time.size)
    runs = [
        driven(par, controller, reference, force)
        for reference, force in ((steps, nothing), (sine, nothing), (still, load))
    ]
    stepped, followed, loaded = (1e6 * (run.x - r) for run, r in zip(runs, (steps, sine, still), strict=True))
    rests = [stepped[3500 - REST : 3500], stepped[-REST:]]
    under = [loaded[4000 - REST : 4000], loaded[-REST:]]
    return [
        max(float(np.abs(e).max()) for e in rests),
        max(float(np.ptp(e)) for e in (*rests, *under)),
        float(np.sqrt(np.mean(followed[1500:] ** 2))),
        max(float(np.abs(e).max()) for e in under),
        rejected(loaded[1000:4000], PERIOD),
        load_error(runs[2], load),
        min((sliding_share(run, controller, name) for run in runs for name in OBSERVERS), default=np.nan),
    ]


def load_error(run: Trace, load: Array) -> float:
    """Return the error of the load estimate at the end of the load, over the load, which pushes toward x = 0."""
    estimate = float(np.mean(run.states[4000 - REST : 4000, layout.S_LOAD]))
    return abs(estimate + load.max()) / load.max()


def sliding_share(run: Trace, controller: Controller, observer: str) -> float:
    """Return the share of samples in sliding of an observer; 1 for a law without it."""
    _, bound, low_pass = OBSERVERS[observer]
    law = LAWS[controller.law]
    if low_pass in law.constants:
        increment = controller.values[bound] * controller.vector()[law.constants[low_pass]]
    elif controller.values["C_DISTURBANCE_OBSERVERS"] > 0.5:
        increment = controller.values[bound]
    else:
        return 1.0
    return float(np.mean(np.abs(np.diff(run.states[:, STATES[observer]])) <= (1.0 - ROUNDING) * increment))


def print_laws(names: Sequence[str], *, is_small: bool = False) -> None:
    """Print a row for each rig and controller, then the worst of each controller; small: of the first alone."""
    worst: dict[str, list[list[float]]] = {}
    print(f"| {' | '.join(HEAD)} |\n|{' --- |' * len(HEAD)}")
    for name in names:
        par = rig(name)
        data = design_data(par, ()) if is_small else design_data(par)
        for title, controller in islice(controllers(data), 1 if is_small else None):
            found = figures(par, controller)
            worst.setdefault(title, []).append(found)
            print_row(name, title, found, estimates_load=LAWS[controller.law].estimates_load)
    for title, rows in worst.items():
        those = np.array(rows)
        last = [*those[:, :-1].max(axis=0), those[:, -1].min()]
        print_row("worst", title, last, estimates_load=not np.isnan(last[-1]))


def print_row(name: str, title: str, found: Sequence[float], *, estimates_load: bool) -> None:
    """Print a row; the last two figures are those of a load estimate."""
    shown = [f"{value:.3g}" for value in (found if estimates_load else found[:-2])]
    print(f"| {name} | {title} | {' | '.join([*shown, *(['–', '–'] if not estimates_load else [])])} |", flush=True)


def main(arguments: list[str]) -> None:
    """Print one of the tables, or of each a small one."""
    table, *rest = [a for a in arguments if a != rigs.SMALL] or [""]
    is_small = rigs.SMALL in arguments
    if table == "friction" or (is_small and not table):
        print_small_friction() if is_small else print_friction(int(rest[0]) if rest else 1)
    if table == "laws" or (is_small and not table):
        print_laws([SMALL_RIG] if is_small else rest or RIGS, is_small=is_small)


if __name__ == "__main__":
    main(sys.argv[1:])
