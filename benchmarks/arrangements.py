"""Maps and inverses against the truth, for each arrangement of valves: ``python -m benchmarks.arrangements [SEED...]``.

Each arrangement is a healthy rig of the exam. A row says what the map was made of; of its points that recordings
covered and where more than 1 % of the largest gradient flows, the median and 95th percentile of the error over the true
gradient and the share of points whose interval holds the truth; of the inverse, the share of points that is reachable
and the error of the gradient that the answered command truly makes. "no vessel" leaves out the valve tests.
"""

from __future__ import annotations

import re
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import small
from pneucli.config import load
from pneucli.exam.cases import generate_case
from pneucli.exam.conditions import parse
from pneucli.io.artifacts import read_table
from pneucli.pipeline.context import Context
from pneucli.stages import identify, ingest
from pneucli.units import parse_quantity

Array = NDArray[np.float64]
CASES = (
    ("one chamber (3/2)", "valve", "usual"),
    ("5/3, null near 5 V", "valve", "5/3-null"),
    ("two valves", "valve", "two-valves"),
    ("switching", "valve", "switching"),
    ("switching, two valves", "valve", "switching+two-valves"),
    ("vessel behind hose and tank", "valve", "tank"),
    ("one chamber, no vessel", "axis", "usual"),
    ("5/3, null near 5 V, no vessel", "axis", "5/3-null"),
    ("two valves, no vessel", "axis", "two-valves"),
    ("switching, no vessel", "axis", "switching"),
)
SEEDS = (14, 21)
SLIGHT = 0.01
GAS, TEMPERATURE, KAPPA = 287.0, 293.15, 1.4


class Truth:
    """The gradient that the rig truly makes in a volume, from what was sealed of the case."""

    def __init__(self, base: dict[str, float], rig: dict[str, Any]) -> None:
        self.base, self.valve = base, rig.get("valve", {})
        self.supply, self.ambient = (parse_quantity(rig[f"{n}_pressure"], "Pa") for n in ("supply", "ambient"))

    def __call__(self, u: Array, p: Array, chamber: int, volume: float) -> Array:
        """Return dp/dt in Pa/s at commands u (V) and pressures p (Pa), by thesis 2.22, 2.42, 2.46."""
        opening = u - self.base["null_V"]
        if chamber == 2 and self.valve["arrangement"] == "5/3":
            opening = -opening
        fills = opening > 0
        high, low = np.where(fills, self.supply, p), np.where(fills, p, self.ambient)
        b = self.base["critical_ratio"]
        ratio = np.clip((np.minimum(low / high, 1.0) - b) / (1.0 - b), 0.0, 1.0)
        flow = self._area(np.abs(opening), chamber) * high * np.sqrt(2 / (GAS * TEMPERATURE) * (1 - ratio**2)) * 0.484
        return np.asarray(KAPPA * GAS * TEMPERATURE / volume * np.where(fills, flow, -flow))

    def _area(self, opening: Array, chamber: int) -> Array:
        names = ("effective_area{}_at_10V", "overlap{}_V", "area_exponent{}")
        area, overlap, exponent = (self.base[name.format("_2" if chamber == 2 else "")] for name in names)
        full = self.base["fully_open_V"]
        if self.valve.get("kind") == "switching":
            return area * (opening > 0.5 * full)
        return np.asarray(area * (np.maximum(opening - overlap, 0.0) / (full - overlap)) ** exponent)


def rows(
    folder: Path, kind: str, condition: str, seed: int, *, is_small: bool = False
) -> Iterator[tuple[int, str, list[float]]]:
    """Yield chamber, what the map is, and the figures, of each chamber of a case."""
    truth = generate_case(folder, kind, (), "", 1.0, seed, parse(condition))
    path = folder / "pipeline.toml"
    if kind == "axis":
        path.write_text(_without_vessel(path.read_text()))
    if is_small:
        small.shorten(path)
    seen = ingest.run(Context(path, load(path), folder / "ingest", folder))
    answer = identify.run(Context(path, load(path), folder / "identify", folder, answers={"ingest": seen}))
    true = Truth(truth["base"], tomllib.loads(path.read_text())["rig"])  # type: ignore[arg-type]
    for chamber, name in ((1, "valve"), (2, "valve_2")):
        if name in answer:
            volume = answer[name]["volume"]["value"]
            tables = [_of(folder / "identify" / f"valve_{table}.parquet", chamber) for table in ("map", "inverse")]
            yield chamber, answer[name]["map"], [*_map(tables[0], true, volume), *_inverse(tables[1], true, volume)]


def _without_vessel(text: str) -> str:
    """Return a pipeline file without its valve tests."""
    head, *recordings = text.split("[[recordings]]")
    kept = [one for one in recordings if 'experiment = "valve"' not in one]
    return "[[recordings]]".join([re.sub(r"\[rig\.vessel\]\nvolume.*\n", "", head), *kept])


def _of(path: Path, chamber: int) -> dict[str, Array]:
    table = {name: np.asarray(values) for name, values in read_table(path).items()}
    mine = table["chamber"] == chamber if "chamber" in table else np.ones(table["p"].size, dtype=bool)
    return {name: values[mine] for name, values in table.items()} | {"of": np.full(mine.sum(), float(chamber))}


def _map(table: dict[str, Array], true: Truth, volume: float) -> list[float]:
    truth = true(table["u"], table["p"], int(table["of"][0]), volume)
    largest = np.abs(truth).max()
    told = table["covered"] & (np.abs(truth) > SLIGHT * largest)
    off = np.abs(table["p_gradient"] - truth)[told] / np.abs(truth[told])
    held = (table["p_gradient_ci_low"] <= truth) & (truth <= table["p_gradient_ci_high"])
    return [float(np.mean(table["covered"])), *np.quantile(off, (0.5, 0.95)), float(np.mean(held[told]))]


def _inverse(table: dict[str, Array], true: Truth, volume: float) -> list[float]:
    made = true(table["u"], table["p"], int(table["of"][0]), volume)
    asked = table["p_gradient"]
    told = table["reachable"] & (np.abs(asked) > SLIGHT * np.abs(asked).max())
    off = np.abs(made - asked)[told] / np.abs(asked[told])
    return [float(np.mean(table["reachable"])), *(np.quantile(off, (0.5, 0.95)) if off.size else (np.nan, np.nan))]


def main(arguments: list[str]) -> None:
    """Print a row for each arrangement and chamber: the mean of the figures over the seeds."""
    is_small = small.SMALL in arguments
    seeds = SEEDS[:1] if is_small else [int(seed) for seed in arguments] or SEEDS
    print("| arrangement | chamber | map | covered | median | 95 % | truth inside | reachable | median | 95 % |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, kind, condition in CASES[:1] if is_small else CASES:
        found: dict[tuple[int, str], list[list[float]]] = {}
        for seed in seeds:
            with tempfile.TemporaryDirectory() as folder:
                for chamber, what, figures in rows(Path(folder) / "case", kind, condition, seed, is_small=is_small):
                    found.setdefault((chamber, what), []).append(figures)
        for (chamber, what), figures in found.items():
            means = [f"{100 * x:.3g} %" for x in np.nanmean(figures, axis=0)]
            print(f"| {name} | {chamber} | {what} | {' | '.join(means)} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
