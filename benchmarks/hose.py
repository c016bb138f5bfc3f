"""How well do the two models of a hose follow a line? ``python -m benchmarks.hose [SEED...]``

A vessel is filled and vented at random commands through a line of 20 segments with inertia and friction. A row for each
line: what is left of the pressure, times the sensor's noise, by the model without a hose, with its flow delayed, and
with a bore; the delay by the last two over length / speed of sound, and the bore over the true one.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numba import njit

from benchmarks.rigs import study_of
from pneucli.arrays import Array
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.physics.effects import catalogue

RT, KAPPA, AMBIENT, SUPPLY, VISCOSITY = 287.0 * 293.15, 1.4, 1.013e5, 7e5, 1.82e-5
SOUND = float(np.sqrt(KAPPA * RT))  # m/s
PERIOD, NOISE, DURATION, STEPS, SEGMENTS = 1e-3, 200.0, 20.0, 200, 20  # s, Pa, s, per sample, of the line
AREA = 2e-6  # m^2 at 10 V, in proportion to the command
COMMANDS = (1.0, 2.5, 5.0, 10.0)  # V
LINES = ((0.5, 3e-3, 1e-4), (1.0, 2.7e-3, 3e-5), (2.0, 4e-3, 2e-4), (5.0, 6e-3, 4e-4))  # length, bore, vessel: m, m^3
HOSE = catalogue()["line-delay"]
DELAY_ALONE = replace(HOSE, parameters=tuple(replace(p, typical=()) if p.refines else p for p in HOSE.parameters))
PIPELINE = """
[pipeline]
name = "hose"
[rig]
gas_temperature = "20 degC"
ambient_pressure = "{ambient} Pa"
supply_pressure = "{supply} Pa"
[rig.vessel]
volume = "{volume} m^3"
[signals]
time = {{ column = "t", unit = "s" }}
u = {{ column = "u", unit = "V" }}
p1 = {{ column = "p", unit = "Pa", reference = "absolute" }}
[[recordings]]
name = "random"
file = "random.csv"
experiment = "valve"
use = "train"
"""


@njit
def valve_flow(u: float, p: float) -> float:
    """Return the mass flow in kg/s into an outlet at p, by the elliptic flow function."""
    up, down = (SUPPLY, p) if u > 0.0 else (p, AMBIENT)
    sign = 1.0 if u > 0.0 else -1.0
    if down > up:
        up, down, sign = down, up, -sign
    s = max(down / up - 0.528, 0.0) / (1.0 - 0.528)
    return float(sign * AREA * abs(u) / 10.0 * 0.484 * np.sqrt(2.0 / RT) * up * np.sqrt(1.0 - s * s))


@njit
def behind_line(command: Array, length: float, bore: float, volume: float) -> Array:
    """Return the pressure (n,) of a vessel behind a line, from 3 bar."""
    area, dx, h = 0.25 * np.pi * bore * bore, length / SEGMENTS, PERIOD / STEPS
    p, q, out = np.full(SEGMENTS + 1, 3e5), np.zeros(SEGMENTS), np.empty(command.size)
    for k in range(command.size):
        out[k] = p[SEGMENTS]
        for _ in range(STEPS):
            for i in range(SEGMENTS):
                density = (p[i] if q[i] > 0.0 else p[i + 1]) / RT
                speed = abs(q[i]) / (density * area)
                turbulent = 0.158 * (VISCOSITY * speed**3 / (density * bore)) ** 0.25 / bore
                friction = max(32.0 * VISCOSITY / (density * bore * bore), turbulent)
                if i == SEGMENTS - 1:
                    friction += 0.75 * speed / dx  # both sharp ends
                q[i] = (q[i] + h * area / dx * (p[i] - p[i + 1])) / (1.0 + h * friction)
            come = valve_flow(command[k], p[0])
            for i in range(SEGMENTS + 1):
                gone = q[i] if i < SEGMENTS else 0.0
                p[i] += h * KAPPA * RT / (area * dx if i < SEGMENTS else volume) * (come - gone)
                come = gone
    return out


def record(folder: Path, line: tuple[float, float, float], seed: int, duration: float) -> None:
    """Write the pipeline of a vessel behind a line; as usual the stated volume contains the hose."""
    rng, n = np.random.default_rng(seed), round(duration / PERIOD)
    command = np.concatenate(
        [np.full(rng.integers(50, 500), rng.choice(COMMANDS) * rng.choice((-1, 1))) for _ in range(n)][: n // 50]
    )[:n]
    length, bore, volume = line
    read = behind_line(command, *line) + NOISE * rng.standard_normal(n)
    stated = volume + 0.25 * np.pi * bore**2 * length
    text = PIPELINE.format(ambient=AMBIENT, supply=SUPPLY, volume=stated)
    (folder / "pipeline.toml").write_text(text, encoding="utf-8")
    columns = np.column_stack([PERIOD * np.arange(n), command, read])
    np.savetxt(folder / "random.csv", columns, delimiter=",", header="t,u,p", comments="", fmt="%.9g")


def row(line: tuple[float, float, float], seed: int, duration: float) -> str:
    """Return one row of the table."""
    with tempfile.TemporaryDirectory() as made, tempfile.TemporaryDirectory() as out:
        record(Path(made), line, seed, duration)
        study = study_of(Path(made), Path(out))
        models = study.residual_models("train")
        guess = study.guess()
        bare, late, whole = (fit_model(guess, models, e) for e in ((), (DELAY_ALONE,), (HOSE,)))
    length, bore, volume = line

    def left(fitted: Fit) -> str:
        return f"{np.sqrt(fitted.cost / fitted.residual.size):.2f}"

    def delay(fitted: Fit) -> str:
        return f"{fitted['line-delay.delay'].value * SOUND / length:.2f}"

    found = whole.model.values.get("line-delay.bore", 0.0) / bore
    cells = [f"{length:g}", f"{1e3 * bore:g}", f"{1e6 * volume:.0f}", left(bare), left(late), left(whole)]
    return "| " + " | ".join([*cells, delay(late), delay(whole), f"{found:.2f}"]) + " |"


def main(arguments: list[str]) -> None:
    """Print the table."""
    is_small = "--small" in arguments
    head = "length, m | bore, mm | vessel, cm3 | left without | delayed | with bore | delay | delay with bore | bore"
    print(f"| {head} |\n|{' --- |' * 9}")
    for seed in [0] if is_small else [int(one) for one in arguments] or [0]:
        for line in LINES[:1] if is_small else LINES:
            print(row(line, seed, 2.0 if is_small else DURATION), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
