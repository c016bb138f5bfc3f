"""A regression without simulation relative to ``ingest`` and ``identify``: ``python -m benchmarks.weak_axis CASE...``

CASE is an axis with tests of its valve, an accelerometer, a closed chamber 2, and a ``truth.json`` that hides a leak
across the piston. The regression estimates areas of the valve, the leak, friction and mass by the weak form: each
balance is multiplied by test functions and integrated by parts, so no pressure is differentiated. Regression and
program know the rig's effects. Parameters and processor seconds are printed; imports count for neither.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomlkit
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from benchmarks import cost, small
from benchmarks.measure import IMPORTS
from pneucli.config import load
from pneucli.exam.cases import generate_case
from pneucli.physics.gas import critical_ratio_of, flow_constant
from pneucli.physics.vectorised import flow_functions
from pneucli.recording import Rig
from pneucli.units import factor_and_offset

Array = NDArray[np.float64]

SUPPORT, STRIDE = 41, 10  # samples of a test function, and from one to the next
PLACE = np.linspace(-1.0, 1.0, SUPPORT + 2)[1:-1]
BUMP = (1.0 - PLACE**2) ** 2 / np.sum((1.0 - PLACE**2) ** 2)
BUMP_SLOPE = -8.0 * PLACE * (1.0 - PLACE**2) / ((SUPPORT + 1) * np.sum((1.0 - PLACE**2) ** 2))  # a sample
SLOPE = np.arange(10.0, -11.0, -1.0) / 770.0  # least squares over 21 samples
KNOTS = (0.0, 0.03, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)  # of the largest command
MAX_RATIO = 0.95  # of the pressures at the valve: near 1 its flow is infinitely steep
MIN_SPEED = 5e-3  # m/s at which the direction is certain
FIT_PHASES = ("reading and preparing", "first fit", "refits", "intervals")  # of :mod:`benchmarks.measure`
STRIBECK_VELOCITIES = (0.005, 0.01, 0.02, 0.04, 0.08)  # m/s


class Balances(NamedTuple):
    """Designs (m, k) and left sides (m,): gas, a pair for each chamber; forces, a design for each velocity."""

    gas: list[tuple[Array, Array]]
    forces: list[tuple[list[Array], Array]]


def windows(values: Array) -> Array:
    return np.asarray(sliding_window_view(values, SUPPORT)[::STRIDE])


def integral(values: Array) -> Array:
    """Return the integrals of a signal (n,) times the test functions."""
    return np.asarray(windows(values) @ BUMP)


def training_signals(path: Path, rig: Rig) -> Iterator[tuple[str, dict[str, Array]]]:
    """Yield kind and signals in SI of each training recording."""
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    for table in (t for t in document["recordings"] if t["use"] == "train"):
        text = (path.parent / table["file"]).read_text(encoding="utf-8").splitlines()
        lines = [line for line in text if not line.startswith("#")]
        columns = dict(zip(lines[0].split(","), np.loadtxt(lines[1:], delimiter=",", unpack=True), strict=True))
        signals = {}
        for name, entry in document["signals"].items():
            if entry["column"] in columns:
                gauge = rig.ambient_pressure if entry.get("reference") == "gauge" else 0.0
                signals[name] = factor_and_offset(entry["unit"])[0] * columns[entry["column"]] + gauge
        yield table["experiment"], signals


def balances(recordings: Sequence[tuple[str, Mapping[str, Array]]], rig: Rig) -> Balances:
    """Return the balances of all recordings.

    Columns of the gas: areas while filling and while venting at ``KNOTS``, area of the leak from chamber 1 to 2. Of the
    forces: mass, Coulomb, viscous, Stribeck rise.
    """
    kappa, heat = rig.heat_capacity_ratio, rig.gas_constant * rig.gas_temperature
    k, b = flow_constant(rig.gas_constant, rig.gas_temperature, kappa), critical_ratio_of(kappa)
    (area_1, area_2), ambient, out = rig.piston_areas, rig.ambient_pressure, Balances([], [])
    top = max(float(np.abs(s["u"]).max()) for _, s in recordings)

    def gas_side(p: Array, volume: Array, swept: Array, period: float) -> Array:
        change = -(windows(p * volume) @ BUMP_SLOPE) / period
        return np.asarray((change / kappa + (1.0 - 1.0 / kappa) * integral(p * swept)) / heat)

    for kind, s in recordings:
        u, p1, supply, period = s["u"], s["p1"], s["p_supply"], float(np.median(np.diff(s["time"])))
        fills = np.where(u > 0.0, supply * k * flow_functions(p1 / supply, b), 0.0)
        vents = np.where(u < 0.0, p1 * k * flow_functions(ambient / p1, b), 0.0)
        hats = [np.interp(np.abs(u), top * np.array(KNOTS), row) for row in np.eye(len(KNOTS))[1:]]
        ratio = np.where(u > 0.0, p1 / supply, np.where(u < 0.0, ambient / p1, 0.0))
        volume, swept, leak = np.full(u.size, rig.vessel_volume or 0.0), np.zeros(u.size), np.zeros(u.size)
        if kind != "valve":
            p2, v = s["p2"], np.convolve(np.pad(s["x"], 10, mode="edge"), SLOPE / period, "valid")
            leak = k * (p1 * flow_functions(p2 / p1, b) - p2 * flow_functions(p1 / p2, b))
            volume, swept = (rig.dead_volume_1 or 0.0) + area_1 * s["x"], area_1 * v
            other = (rig.dead_volume_2 or 0.0) + area_2 * ((rig.stroke or 0.0) - s["x"])
            into = np.array([*np.zeros((2 * len(hats), windows(u).shape[0])), integral(leak)]).T
            out.gas.append((into, gas_side(p2, other, -area_2 * v, period)))
            moving = (windows(v).min(axis=1) > MIN_SPEED) | (windows(v).max(axis=1) < -MIN_SPEED)
            laws = (np.sign(v) / (1.0 + (v / v_s) ** 2) for v_s in STRIBECK_VELOCITIES)
            common = [integral(c) for c in (s["a"], np.sign(v), v)]
            push = area_1 * (p1 - ambient) - area_2 * (p2 - ambient)
            designs = [np.array([*common, integral(law)]).T[moving] for law in laws]
            out.forces.append((designs, integral(push)[moving]))
        design = np.array([integral(c) for c in [*(h * fills for h in hats), *(-h * vents for h in hats), -leak]]).T
        certain = windows(ratio).max(axis=1) < MAX_RATIO
        out.gas.append((design[certain], gas_side(p1, volume, swept, period)[certain]))
    return out


def solved(parts: Sequence[tuple[Array, Array]]) -> tuple[Array, float]:
    """Return the coefficients by least squares, each part over its own error, and the sum of absolute residuals."""
    errors, coefficients = [float(np.std(y)) for _, y in parts], np.zeros(0)
    for _ in range(8):
        design = np.concatenate([x / e for (x, _), e in zip(parts, errors, strict=True)])
        side = np.concatenate([y / e for (_, y), e in zip(parts, errors, strict=True)])
        size = np.linalg.norm(design, axis=0)
        size[size == 0.0] = 1.0
        coefficients = np.linalg.lstsq(design / size, side, rcond=1e-9)[0] / size
        errors = [float(np.std(y - x @ coefficients)) for x, y in parts]
    return coefficients, sum(float(np.abs(y - x @ coefficients).sum()) for x, y in parts)


def regression(path: Path) -> tuple[dict[str, float], float]:
    """Return parameters by name from the training recordings of an axis, and the processor seconds."""
    begun = time.process_time()
    rig = load(path).to_rig()
    found = balances(list(training_signals(path, rig)), rig)
    gas, _ = solved(found.gas)
    forces = [solved([(designs[i], y) for designs, y in found.forces]) for i in range(len(STRIBECK_VELOCITIES))]
    mass, coulomb, viscous, _ = min(forces, key=lambda one: one[1])[0]
    areas = {"area, filling": gas[len(KNOTS) - 2], "area, venting": gas[-2], "leak": gas[-1]}
    values = areas | {"Coulomb friction": coulomb, "viscous friction": viscous, "mass": mass}
    return values, time.process_time() - begun


def identified(path: Path, stages: Sequence[str]) -> tuple[dict[str, float], float, float]:
    """Return the parameters that the program identifies, the seconds of its stages, and those of its fit alone."""
    costs = cost.measure(path, stages, path.parent / "out").values()
    seconds = sum(one.seconds - one.phases.get(IMPORTS, 0.0) for one in costs)
    fit_seconds = sum(one.phases.get(phase, 0.0) for one in costs for phase in FIT_PHASES)
    if "identify" not in stages:
        return {}, seconds, fit_seconds
    answer = json.loads((path.parent / "out" / "identify" / "stage.json").read_text(encoding="utf-8"))["answer"]
    values = {name: entry["value"] for name, entry in answer["model"]["parameters"].items()}
    areas = [name for name in values if name.startswith("valve.effective_area(")]  # from one end to the other
    names = {"area, filling": areas[-1], "area, venting": areas[0], "leak": "piston-leak.area"}
    names |= {"Coulomb friction": "friction.coulomb", "viscous friction": "friction.viscous"}
    return {title: values[name] for title, name in names.items() if name in values}, seconds, fit_seconds


def print_axis(case: Path, stages: Sequence[str] = ("ingest", "identify")) -> None:
    """Print parameters and times of both ways for a case with ``truth.json``."""
    truth = json.loads((case / "truth.json").read_text(encoding="utf-8"))
    base, area = truth["base"], truth["base"]["effective_area_at_10V"]
    true = {"area, filling": area, "area, venting": area, "leak": truth["hidden"]["piston-leak"]["area"]}
    true |= {"Coulomb friction": base["coulomb"], "viscous friction": base["viscous"]}
    true["mass"] = load(case / "pipeline.toml").to_rig().moving_mass
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "pipeline.toml"
        for entry in case.iterdir():
            (Path(folder) / entry.name).symlink_to(entry.resolve())
        document: Any = tomlkit.parse(path.read_text(encoding="utf-8"))
        document["model"]["effects"] = [*truth["baseline"], *truth["hidden"]]
        path.unlink()
        path.write_text(tomlkit.dumps(document), encoding="utf-8")
        (weak, fast), (program, slow, fit_seconds) = regression(path), identified(path, stages)
    print("| parameter | truth | weak form, error in % | `identify`, error in % |\n| --- | --- | --- | --- |")
    for name, value in true.items():
        errors = [f"{100.0 * (found[name] / value - 1.0):+.2f}" if name in found else "" for found in (weak, program)]
        print(f"| {name} | {value:.4g} | {' | '.join(errors)} |")
    for name, spent in (("all", slow), ("the fit alone", fit_seconds)):
        print(f"| seconds, {name} | | {fast:.2f} | {spent:.1f} ({spent / fast:.0f} times) |")


def main(arguments: list[str]) -> None:
    """Print the table of each case."""
    if small.SMALL in arguments:
        with tempfile.TemporaryDirectory() as folder:
            case = Path(folder) / "case"
            truth = generate_case(case, "axis", ("piston-leak",), "", 1.0, 1)
            (case / "truth.json").write_text(json.dumps(truth), encoding="utf-8")
            print_axis(case, ["ingest"])
    else:
        os.environ["PNEUCLI_THREADS"] = "1"
        for name in arguments:
            print_axis(Path(name))


if __name__ == "__main__":
    main(sys.argv[1:])
