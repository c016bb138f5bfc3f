"""Does learning pay? ``python -m benchmarks.learning [EFFECT ...]``: designed without an effect, then with it.

Each axis of the exam has one effect of the catalogue; a controller is designed from a model that does not know it, and
from one that does, and both drive the exam's rig. Figures in um: largest error over the last half second at rest after
steps of 15 % of the stroke, how far the piston moves there, rms error on a sine of 15 % at 0.5 Hz (30 mm on 200 mm),
largest error at rest under 50 N (scaled by the area over 8 cm^2), and after how long in s it is rejected to 50 um; the
command's rms above 50 Hz in V, the air of all three runs in g.
``PERIOD`` (ms), ``SEEDS``, ``UNTOLD=1`` (presliding of 40 kN/m, 5 ms of lag, 0.1 V of play that no model knows; at
rest 100 um count as held), ``RECORDED=1`` (models identified by ``pneucli identify`` from recordings of each rig; in
the folder ``MODELS`` they are kept for the next controller).

Learning pays where it acts and costs nothing elsewhere: where a rig is at least 20 % worse with the effect than
without it (medians over the seeds), the design that knows it must be better; elsewhere it may be worse by at most 10 %
or the tolerance of 10 um. Figures that break this are listed at the end.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray
from scipy.signal import welch

from benchmarks.exam_loop import designed
from benchmarks.rigs import driven, model_of
from pneucli import config
from pneucli.controller.parameters import Controller
from pneucli.design.cascade_design import design_cascade
from pneucli.design.requirements import Requirements
from pneucli.exam.case_rig import draw_rig
from pneucli.exam.cases import generate_case, prepare_case
from pneucli.exam.conditions import Conditions
from pneucli.exam.hidden_effects import BY_NAME, CATALOGUE
from pneucli.exam.rig.parameters import ONE_CHAMBER, Parameters
from pneucli.physics.effects import catalogue, select_effects
from pneucli.simulate.model import Model
from pneucli.stages.model_file import load_model

Array = NDArray[np.float64]
WORST = (
    "none", "valve-lag", "pressure-friction", "position-friction", "friction-hysteresis", "presliding",
    "dwell-breakaway", "line-delay", "pressure-lag", "time-skew", "valve-hysteresis", "stribeck",
)  # fmt: skip
LIMITS = {"rest": 100.0 if os.environ.get("UNTOLD") else 50.0, "sine": 500.0, "load": 100.0}
TOLERANCE = 10.0  # um
HEAD = ("rest", "moves", "sine", "load", "moves'", "after", "fast", "air")


def rig(seed: int, effect: str = "none") -> Parameters:
    """Return an axis of the exam with one effect at its full size."""
    rng = np.random.default_rng(seed)
    par = draw_rig("axis", False, rng)
    return par if effect == "none" else BY_NAME[effect].apply(par, 1.0, rng)


def untold(par: Parameters) -> Parameters:
    """Return a rig with what any has: bristles, a slow spool and play.

    No bristles where an effect would vanish with them: the rig's have neither two branches nor a memory of rest.
    """
    stiffness = 4e4 * par.piston_area_1 / 8e-4
    rigid = par.drop > 0.0 or par.dwell_gain > 0.0
    known = rigid or par.bristle_stiffness > 0.0
    more = {} if known else {"bristle_stiffness": stiffness, "bristle_damping": 2e-3 * stiffness}
    return par._replace(valve_lag=max(par.valve_lag, 5e-3), valve_half_width=max(par.valve_half_width, 0.1), **more)


def design(model: Model, par: Parameters, period: float, quantum: float = 1e-6, noise: float = 400.0) -> Controller:
    """Return the controller for a model of the rig."""
    asked = Requirements(
        period=period, quantum_x=quantum, noise_p=noise,
        chamber_2="closed" if par.arrangement == ONE_CHAMBER else "valve",
    )  # fmt: skip
    return design_cascade(model, asked, np.sqrt(par.ambient * par.supply) if par.arrangement == ONE_CHAMBER else None)


def figures(par: Parameters, c: Controller, quantum: float = 1e-6, noise: float = 400.0) -> list[float]:
    """Return the figures of one controller on one rig."""
    h = c.period
    time = h * np.arange(round(6.5 / h))
    middle = 0.5 * par.stroke
    steps = middle + par.stroke * np.where(time < 0.5, 0.0, np.where(time < 3.5, 0.15, -0.15))
    sine = middle + 0.15 * par.stroke * np.sin(np.pi * np.maximum(time - 0.5, 0.0))
    push = 50.0 * par.piston_area_1 / 8e-4 * np.where((time >= 1.0) & (time < 4.0), 1.0, 0.0)
    nothing, still, last = np.zeros(time.size), np.full(time.size, middle), round(0.5 / h)

    def run(reference: Array, load: Array) -> tuple[Array, Array, float]:
        done = driven(par, c, reference, load, noise, quantum)
        return 1e6 * (done.x - reference), done.u, done.air

    (e, u, air), (followed, v, more), (loaded, w, most) = run(steps, nothing), run(sine, nothing), run(still, push)
    ends = [e[round(3.5 / h) - last : round(3.5 / h)], e[-last:]]
    under = [loaded[round(4.0 / h) - last : round(4.0 / h)], loaded[-last:]]
    return [
        max(float(np.abs(one).max()) for one in ends),
        max(float(np.ptp(one)) for one in ends),
        float(np.sqrt(np.mean(followed[round(1.5 / h) :] ** 2))),
        max(float(np.abs(one).max()) for one in under),
        max(float(np.ptp(one)) for one in under),
        recovered(loaded[round(1.0 / h) : round(4.0 / h)], h),
        float(np.sqrt(np.mean([fast(one, h) ** 2 for one in (u, v, w)]))),
        1e3 * (air + more + most),
    ]


def recovered(error: Array, h: float) -> float:
    """Return after how long in s an error (um) comes to within 50 um for good, infinite where it does not."""
    off = np.flatnonzero(np.abs(error) > 50.0)
    return 0.0 if off.size == 0 else h * (off[-1] + 1) if off[-1] + 1 < error.size else np.inf


def fast(u: Array, h: float) -> float:
    """Return the rms above 50 Hz in V."""
    frequency, power = welch(u, 1.0 / h, nperseg=round(1.024 / h))
    return float(np.sqrt(np.sum(power[frequency > 50.0]) * frequency[1]))


def holds(found: list[float]) -> bool:
    """Whether an axis is held."""
    return found[0] <= LIMITS["rest"] and found[2] <= LIMITS["sine"] and found[3] <= LIMITS["load"]


def exact(seed: int, name: str) -> tuple[Parameters, Model, Model]:
    """Return a rig, the model that does not know its effect, and the one that does, with exact parameters."""
    par = rig(seed, name)
    known = () if name == "none" else (name,)
    return par, model_of(par), model_of(par, known)


def recorded(seed: int, name: str) -> tuple[Parameters, Model, Model]:
    """Return the same with both models identified from the rig's recordings, by the program's own command."""
    hidden = () if name == "none" else (name,)
    par = prepare_case("rig", "axis", hidden, "", 1.0, seed, Conditions()).laboratory.parameters
    with tempfile.TemporaryDirectory() as place:
        folder = Path(os.environ.get("MODELS", place)) / f"{name}-{seed}"
        without = kept(folder / "without", seed, hidden)
        return par, without, kept(folder / "known", seed, hidden, hidden) if hidden else without


def kept(folder: Path, seed: int, hidden: tuple[str, ...], known: tuple[str, ...] = ()) -> Model:
    """Return the model that ``pneucli identify`` found for recordings of a rig, which are made where it has not yet."""
    if (folder / "out/identify/model.parquet").exists():
        return loaded(folder)
    folder.mkdir(parents=True, exist_ok=True)
    generate_case(folder, "axis", hidden, "", 1.0, seed)
    file = folder / "pipeline.toml"
    document: Any = tomlkit.parse(file.read_text())
    model = document.setdefault("model", tomlkit.table())
    model["effects"] = sorted({*model.get("effects", []), *known})
    file.write_text(tomlkit.dumps(document))
    found = identified(folder)
    shutil.rmtree(folder / "raw")
    return found


def identified(folder: Path) -> Model:
    """Return the model that ``pneucli identify`` finds for a folder's pipeline."""
    designed(folder, ["identify"])
    return loaded(folder)


def loaded(folder: Path) -> Model:
    """Return the model that was identified."""
    settings = config.load(folder / "pipeline.toml")
    return load_model(folder / "out/identify", settings.to_rig(), select_effects(settings.model.effects, catalogue()))


@cache
def healthy(seed: int, period: float) -> tuple[float, ...]:
    """Return the figures of a rig without any effect, its model as exact as the others."""
    par, model, _ = models(seed, "none")
    return tuple(figures(untold(par) if os.environ.get("UNTOLD") else par, design(model, par, period)))


def models(seed: int, name: str) -> tuple[Parameters, Model, Model]:
    """Return a rig and its two models, exact or, with ``RECORDED``, identified."""
    return (recorded if os.environ.get("RECORDED") else exact)(seed, name)


def broken(name: str, without: Array, known: Array, none: Array) -> list[str]:
    """Return which of the judged figures (medians, um) learning did not improve where it should, or made worse."""
    said = []
    for key, before, after, clean in zip(HEAD, without, known, none, strict=True):
        if key not in LIMITS:
            continue
        acted = before > 1.2 * clean and before - clean > TOLERANCE
        allowed = before if acted else before + max(0.1 * before, TOLERANCE)
        if after > allowed:
            said.append(f"{name}: {key} {before:.3g} -> {after:.3g} um, {clean:.3g} without the effect")
    return said


def main(arguments: list[str]) -> None:
    """Print the figures without and with each effect, and where learning did not pay."""
    period = 1e-3 * float(os.environ.get("PERIOD", "1"))
    seeds = range(1, 1 + int(os.environ.get("SEEDS", "1")))
    asked = ["none"] if "--small" in arguments else arguments or WORST
    if asked == ["all"]:
        asked = ["none", *(e.name for e in CATALOGUE if "axis" in e.kinds or "friction" in e.kinds)]
    held, count, worse = np.zeros(2, dtype=int), 0, []
    for name in asked:
        rows: list[list[list[float]]] = [[], []]
        for seed in seeds:
            par, *both = models(seed, name)
            actual = untold(par) if os.environ.get("UNTOLD") else par
            for i, model in enumerate(both):
                try:
                    rows[i].append(figures(actual, design(model, par, period)))
                except Exception as error:
                    print(name, repr(error)[:200])
                    rows[i].append([np.inf] * len(HEAD))
            held += [holds(rows[0][-1]), holds(rows[1][-1])]
            count += 1
        none = np.median([healthy(seed, period) for seed in seeds], axis=0)
        worse += broken(name, np.median(rows[0], axis=0), np.median(rows[1], axis=0), none)
        shown = [" ".join(f"{x:8.3g}" for x in np.median(row, axis=0)) for row in rows]
        good = ["".join("+" if holds(r) else "-" for r in row) for row in rows]
        print(f"{name:20s} {shown[0]} {good[0]} | {shown[1]} {good[1]}", flush=True)
    print(f"held: {held[0]} without, {held[1]} with the effect known, of {count}")
    print("\n".join(["learning did not pay:", *worse] if worse else ["learning paid everywhere"]))


if __name__ == "__main__":
    main(sys.argv[1:])
