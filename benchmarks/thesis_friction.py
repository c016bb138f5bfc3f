"""The thesis's friction, identified and diagnosed: ``python -m benchmarks.thesis_friction [SEED]``.

A bench of its own, which shares no code with the program: friction on two branches (3.6 while speeding up, Coulomb and
viscous while slowing, 3.7 and 6.21; between them the speed stays), stepped by 10 us. Two kinds of recordings:

- ``hysteresis``: a piston of 2.2 kg follows sines and rests, driven by a measured force; drops of 0, 0.2 and 0.4, and a
  viscous constant of its own while slowing. The pipeline's model has Stribeck friction alone.
- ``stick-slip``: the thesis's bench (3.7 N static, 2 N Coulomb, 15 N s/m, 0.019 m/s, 0.15 kg): a small flow fills
  chamber 1, chamber 2 is open, the piston slips one way. Recorded p1 with a, with x and a, or with v.

Prints what ``diagnose`` names with its parameters and intervals, and models A and D of ``identify`` against the truth.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from pneucli.caches import compiled

Array = NDArray[np.float64]
STEP, EVERY = 1e-5, 100  # s; of which one is recorded
AMBIENT, GAS, KAPPA = 101_300.0, 287.0 * 293.15, 1.4
RUNS = 4


class Friction(NamedTuple):
    """Friction of the bench and the mass that it brakes."""

    mass: float = 2.2
    coulomb: float = 14.0
    static: float = 22.0
    velocity: float = 0.015
    viscous: float = 45.0
    drop: float = 0.0
    viscous_drop: float = 0.0


THESIS = Friction(0.15, 2.0, 3.7, 0.019, 15.0)
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
def driven(f: Friction, reference: Array, rate: Array) -> Array:
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
    """The JSON answer of a stage."""
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


def main_small() -> None:
    """Write one rig without hysteresis and ingest its recordings."""
    rng, f = np.random.default_rng(1), Friction()
    with tempfile.TemporaryDirectory() as name:
        write(Path(name), [driven(f, *reference(rng)) for _ in range(RUNS)], (0.1, 1e-6, 1e-4, 0.04), rng)
        found = answer("ingest", pipeline(Path(name), f, "force", "xa", '"stribeck"'))
    print(f"{len(found['recordings'])} recordings")


def main(arguments: list[str]) -> None:
    """Print the answers and the models of each rig."""
    if "--small" in arguments:
        main_small()
        return
    seed = int(arguments[0]) if arguments else 1
    with tempfile.TemporaryDirectory() as name:
        for drop, viscous_drop in ((0.0, 0.0), (0.2, 0.0), (0.4, 0.0), (0.1, 0.4)):
            rng, f = np.random.default_rng(seed), Friction(drop=drop, viscous_drop=viscous_drop)
            folder = Path(name, f"{drop}-{viscous_drop}")
            folder.mkdir()
            write(folder, [driven(f, *reference(rng)) for _ in range(RUNS)], (0.1, 1e-6, 1e-4, 0.04), rng)
            path = pipeline(folder, f, "force", "xa", '"stribeck"')
            print(f"drop {drop}, viscous {viscous_drop}: {named(path)}")
        rng, folder = np.random.default_rng(seed), Path(name, "stick-slip")
        folder.mkdir()
        runs = [filled(THESIS, 2.2e-6 * rng.uniform(0.5, 1.6), 12_001) for _ in range(RUNS)]
        write(folder, runs, (25.0, 5e-7, 5e-5, 0.03), rng)
        for signals in ("a", "xa", "v"):
            path = pipeline(folder, THESIS, "p1", signals, "")
            print(f"p1 and {signals}: {models(path)}")
            print(f"p1 and {signals}: {named(path)}")


if __name__ == "__main__":
    main(sys.argv[1:])
