"""False but well-formed data sets, each made of good recordings by one mistake: ``python -m tests.plausibility.false_sets``.

Prints a table of what ``ingest`` finds in each; with ``--diagnose`` also what ``diagnose`` answers.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.config import load
from pneucli.pipeline.context import Context
from pneucli.stages import diagnose, ingest

Array = NDArray[np.float64]
Columns = dict[str, Array]
FIXTURES = Path(__file__).parents[2] / "fixtures"

T, U, PS, P1, P2, X, A = "t [ms]", "U_valve [V]", "P_supply [bar]", "P1 [bar]", "P2 [bar]", "Pos [mm]", "Acc [m/s2]"
BASES = {  # a few recordings of each rig, so that the tests are fast
    "friction": ("friction_null_stribeck", ("stickslip_2", "driven_1", "driven_2")),
    "valve": ("valve_null", ("step_+3.0V", "step_+10.0V", "stairs_1", "stairs_2")),
    "axis": ("demo", ("step_+5.0V", "stairs_1", "axis_1", "axis_3")),
}
NOISES = {"p_supply": "4 mbar", "p1": "4 mbar", "p2": "4 mbar", "x": "0.3 um", "a": "0.05 m/s^2"}


@dataclass(frozen=True)
class Rig:
    """A pipeline file's text and its recordings' columns by name."""

    text: str
    recordings: dict[str, Columns]

    @classmethod
    def of(cls, base: str, *, noise: bool = False) -> Rig:
        """Return good recordings; with ``noise`` the file states it, so that it need not be estimated."""
        folder, names = BASES[base]
        text = (FIXTURES / folder / "pipeline.toml").read_text()
        head, *tables = text.partition("[model]")[0].split("[[recordings]]")
        kept = [table for table in tables if re.search(r'name = "(.*)"', table)[1] in names]  # type: ignore[index]
        text = "[[recordings]]".join([head, *kept]) + "[model]" + text.partition("[model]")[2]
        for name, stated_noise in NOISES.items() if noise else ():
            text = text.replace(f'\n{name} = {{ ', f'\n{name} = {{ noise = "{stated_noise}", ')
        return cls(text, {name: _read(FIXTURES / folder / f"{name}.csv") for name in names})

    def write(self, folder: Path) -> Path:
        """Write all files and return the pipeline file's path."""
        for name, columns in self.recordings.items():
            rows = np.column_stack(list(columns.values()))
            header = ",".join(columns)
            np.savetxt(folder / f"{name}.csv", rows, "%.9g", ",", header=header, comments="")
        (folder / "pipeline.toml").write_text(self.text)
        return folder / "pipeline.toml"


Mistake = Callable[[Rig], Rig]


def _read(path: Path) -> Columns:
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    values = np.loadtxt(lines[1:], delimiter=",", ndmin=2)
    return dict(zip(lines[0].split(","), values.T, strict=True))


def columns(change: Callable[[Columns, np.random.Generator], Columns], only: str = "") -> Mistake:
    """A mistake in the recordings whose name begins with ``only``."""

    def make(rig: Rig) -> Rig:
        rng = np.random.default_rng(0)
        changed = {n: change(dict(c), rng) if n.startswith(only) else c for n, c in rig.recordings.items()}
        return replace(rig, recordings=changed)

    return make


def scaled(factor: float, *names: str, plus: float = 0.0, only: str = "") -> Mistake:
    return columns(lambda c, rng: c | {n: factor * c[n] + plus for n in names if n in c}, only)


def filled(name: str, values: Callable[[int, np.random.Generator], Any], only: str = "") -> Mistake:
    return columns(lambda c, rng: c | ({name: values(c[T].size, rng) + np.zeros(c[T].size)} if name in c else {}), only)


def swapped(first: str, second: str, only: str = "") -> Mistake:
    return columns(lambda c, rng: c | ({first: c[second], second: c[first]} if {first, second} <= c.keys() else {}), only)


def thinned(every: int) -> Mistake:
    return columns(lambda c, rng: {n: values[::every] for n, values in c.items()})


def stated(old: str, new: str) -> Mistake:
    def make(rig: Rig) -> Rig:
        assert re.search(old, rig.text), old
        return replace(rig, text=re.sub(old, new, rig.text))

    return make


def both(*mistakes: Mistake) -> Mistake:
    def make(rig: Rig) -> Rig:
        for mistake in mistakes:
            rig = mistake(rig)
        return rig

    return make


def read_as_absolute(*names: str) -> Mistake:
    """The columns count from ambient pressure, and the file does not say so."""
    return both(*(stated(rf'(\n{n} = .*?), reference = "gauge"', r"\1") for n in names))


def absolute_as_gauge(*names: str) -> Mistake:
    return scaled(1.0, *names, plus=1.013)


def _holes(c: Columns, rng: np.random.Generator) -> Columns:
    return c | {P1: np.where(rng.random(c[P1].size) < 0.5, np.nan, c[P1])}


def _cable(c: Columns, rng: np.random.Generator) -> Columns:
    rows = np.arange(c[X].size)
    return c | {X: np.where((rows > 0.3 * rows.size) & (rows < 0.6 * rows.size), np.nan, c[X])}


def _times(key: str, factor: float) -> Mistake:
    """A value of the rig, off by a factor."""

    def make(rig: Rig) -> Rig:
        found = re.search(rf'{key} = "([\d.]+) ', rig.text)
        assert found
        return replace(rig, text=rig.text.replace(found[0], f'{key} = "{factor * float(found[1]):.6g} '))

    return make


@dataclass(frozen=True)
class FalseSet:
    """One mistake on one rig, and the (check, signal) of which one at least must be found."""

    base: str
    mistake: Mistake
    expected: set[tuple[str, str]]
    named: bool = field(default=False)  # in the report that asked for these checks

    def make(self, *, noise: bool = False) -> Rig:
        return self.mistake(Rig.of(self.base, noise=noise))


AREAS = both(_times("piston_area_1", 100), _times("piston_area_2", 100))
MS_AS_S = stated(r'"t \[ms\]", unit = "ms"', '"t [ms]", unit = "s"')
S_AS_MS = scaled(1e-3, T)
NOISE = lambda mean, std: lambda n, rng: mean + std * rng.standard_normal(n)  # noqa: E731

SETS: dict[str, FalseSet] = {
    # friction: stick-slip with an open chamber 2, driven motion with a closed one
    "friction, p1 dead": FalseSet("friction", filled(P1, lambda n, rng: 1.5), {("silent", "p1")}, named=True),
    "friction, p1 nothing but noise": FalseSet("friction", filled(P1, NOISE(2.0, 0.5)), {("silent", "p1")}, named=True),
    "friction, p1 and p2 swapped": FalseSet("friction", swapped(P1, P2), {("direction", "x"), ("swapped", "p1")}),
    "friction, 5 samples": FalseSet("friction", columns(lambda c, rng: {n: v[:5] for n, v in c.items()}), {("samples", "p1")}, named=True),
    "friction, half of p1 missing": FalseSet("friction", columns(_holes), {("missing", "p1")}, named=True),
    "friction, cable of x loose": FalseSet("friction", columns(_cable), {("missing", "x")}),
    "friction, gauge read as absolute": FalseSet("friction", read_as_absolute("p1", "p2"), {("reference", "p2")}, named=True),
    "friction, absolute read as gauge": FalseSet("friction", absolute_as_gauge(P1, P2), {("reference", "p2")}, named=True),
    "friction, p2 alone gauge read as absolute": FalseSet("friction", read_as_absolute("p2"), {("reference", "p2")}),
    "friction, recorded at 10 Hz": FalseSet("friction", thinned(100), {("sampling", "time")}, named=True),
    "friction, areas 100 times too large": FalseSet("friction", AREAS, {("mass", "x")}, named=True),
    "friction, areas 100 times too small": FalseSet("friction", both(_times("piston_area_1", 0.01), _times("piston_area_2", 0.01)), {("mass", "x"), ("volume", "p2")}),
    "friction, mass in g stated as kg": FalseSet("friction", _times("moving_mass", 1000), {("mass", "x")}),
    "friction, mass in t stated as kg": FalseSet("friction", _times("moving_mass", 1e-3), {("mass", "x")}),
    "friction, x inverted": FalseSet("friction", scaled(-1.0, X), {("direction", "x"), ("direction", "a")}, named=True),
    "friction, x inverted from the other end": FalseSet("friction", scaled(-1.0, X, plus=200.0), {("direction", "x"), ("direction", "a")}),
    "friction, x and a inverted": FalseSet("friction", both(scaled(-1.0, A), scaled(-1.0, X, plus=200.0)), {("direction", "x")}),
    "friction, mm declared as m": FalseSet("friction", stated('"Pos \\[mm\\]", unit = "mm"', '"Pos [mm]", unit = "m"'), {("stroke", "x")}),
    "friction, m declared as mm": FalseSet("friction", scaled(1e-3, X), {("derivative", "a"), ("volume", "p2")}),
    "friction, ms declared as s": FalseSet("friction", MS_AS_S, {("horizon", "time"), ("derivative", "a")}, named=True),
    "friction, s declared as ms": FalseSet("friction", S_AS_MS, {("speed", "x"), ("derivative", "a")}),
    "friction, x dead": FalseSet("friction", filled(X, lambda n, rng: 100.0), {("motionless", "x")}, named=True),
    "friction, x nothing but noise": FalseSet("friction", filled(X, NOISE(100.0, 0.01)), {("motionless", "x")}),
    "friction, x dead in one recording": FalseSet("friction", filled(X, lambda n, rng: 100.0, "driven_2"), {("motionless", "x")}),
    "friction, a dead": FalseSet("friction", filled(A, lambda n, rng: 0.0), {("derivative", "a")}),
    "friction, a nothing but noise": FalseSet("friction", filled(A, NOISE(0.0, 1.0)), {("derivative", "a")}),
    "friction, a inverted": FalseSet("friction", scaled(-1.0, A), {("direction", "a")}),
    "friction, a in g": FalseSet("friction", scaled(1 / 9.81, A), {("derivative", "a")}),
    "friction, kPa declared as bar": FalseSet("friction", scaled(100.0, P1, P2), {("unit", "p1")}),
    "friction, MPa declared as bar": FalseSet("friction", scaled(0.1, P1, P2), {("mass", "x")}),
    "friction, psi declared as bar": FalseSet("friction", scaled(14.504, P1, P2), {("unit", "p1")}),
    "friction, one column for p1 and p2": FalseSet("friction", columns(lambda c, rng: c | {P2: c[P1]}), {("copy", "p2")}),
    "friction, p2 of the closed chamber dead": FalseSet("friction", filled(P2, lambda n, rng: 2.0, "driven"), {("silent", "p2")}),
    "friction, x from another zero": FalseSet("friction", scaled(1.0, X, plus=-150.0), {("stroke", "x")}),
    "friction, stroke in cm": FalseSet("friction", _times("stroke", 0.1), {("stroke", "x")}),
    "friction, dead volume in l": FalseSet("friction", _times("dead_volume_2", 1000), {("volume", "p2")}),
    # valve: charge and discharge of a vessel
    "valve, p1 dead": FalseSet("valve", filled(P1, lambda n, rng: 3.0), {("silent", "p1")}, named=True),
    "valve, p1 nothing but noise": FalseSet("valve", filled(P1, NOISE(3.0, 0.5)), {("silent", "p1")}, named=True),
    "valve, p1 dead in one recording": FalseSet("valve", filled(P1, NOISE(0.0, 0.004), "step_+10"), {("silent", "p1")}),
    "valve, p1 and p_supply swapped": FalseSet("valve", swapped(P1, PS), {("swapped", "p1")}, named=True),
    "valve, 5 samples": FalseSet("valve", columns(lambda c, rng: {n: v[:5] for n, v in c.items()}), {("samples", "p1")}, named=True),
    "valve, half of p1 missing": FalseSet("valve", columns(_holes), {("missing", "p1")}, named=True),
    "valve, vessel 1000 times too large": FalseSet("valve", _times("volume", 1000), {("volume", "p1")}, named=True),
    "valve, vessel 1000 times too small": FalseSet("valve", _times("volume", 1e-3), {("volume", "p1")}),
    "valve, gauge read as absolute": FalseSet("valve", read_as_absolute("p1", "p_supply"), {("reference", "p1")}, named=True),
    "valve, absolute read as gauge": FalseSet("valve", absolute_as_gauge(P1, PS), {("reference", "p1")}, named=True),
    "valve, p_supply alone gauge read as absolute": FalseSet("valve", read_as_absolute("p_supply"), {("reference", "p_supply")}),
    "valve, p_supply dead": FalseSet("valve", filled(PS, lambda n, rng: 0.0), {("supply", "p_supply")}, named=True),
    "valve, ms declared as s": FalseSet("valve", MS_AS_S, {("volume", "p1")}, named=True),
    "valve, s declared as ms": FalseSet("valve", S_AS_MS, {("volume", "p1")}),
    "valve, u dead": FalseSet("valve", filled(U, lambda n, rng: 0.0), {("silent", "u")}, named=True),
    "valve, u another signal": FalseSet("valve", filled(U, NOISE(0.0, 3.0)), {("silent", "u")}, named=True),
    "valve, u inverted": FalseSet("valve", scaled(-1.0, U), {("direction", "u")}),
    "valve, mV declared as V": FalseSet("valve", scaled(1000.0, U), {("unit", "u")}),
    "valve, p1 in kPa declared as bar": FalseSet("valve", scaled(100.0, P1), {("unit", "p1"), ("supply", "p_supply")}),
    "valve, p1 a tenth": FalseSet("valve", scaled(0.1, P1), {("supply", "p_supply")}),
    "valve, p_supply a tenth": FalseSet("valve", scaled(0.1, PS), {("supply", "p_supply")}),
    "valve, recorded at 5 Hz": FalseSet("valve", thinned(200), {("sampling", "time")}),
    # axis: the valve on its bench, then with a closed chamber 2
    "axis, p1 dead": FalseSet("axis", filled(P1, lambda n, rng: 3.0, "axis"), {("silent", "p1")}, named=True),
    "axis, x inverted": FalseSet("axis", scaled(-1.0, X, plus=200.0), {("direction", "x")}, named=True),
    "axis, p1 and p2 swapped": FalseSet("axis", swapped(P1, P2, "axis"), {("direction", "x"), ("direction", "u")}),
    "axis, p1 and p_supply swapped": FalseSet("axis", swapped(P1, PS, "axis"), {("swapped", "p1")}, named=True),
    "axis, areas 100 times too large": FalseSet("axis", AREAS, {("mass", "x")}, named=True),
    "axis, vessel 1000 times too large": FalseSet("axis", _times("volume", 1000), {("volume", "p1")}, named=True),
    "axis, gauge read as absolute": FalseSet("axis", read_as_absolute("p_supply", "p1", "p2"), {("reference", "p2"), ("reference", "p1")}, named=True),
    "axis, u inverted": FalseSet("axis", scaled(-1.0, U, only="axis"), {("direction", "u")}),
    "axis, x dead": FalseSet("axis", filled(X, lambda n, rng: 100.0), {("motionless", "x")}, named=True),
    "axis, recorded at 10 Hz": FalseSet("axis", thinned(100), {("sampling", "time")}),
}


def looked_at(rig: Rig, folder: Path) -> dict[str, Any]:
    """Return the answer of ``ingest``."""
    path = rig.write(folder)
    return ingest.run(Context(path, load(path), folder / "out" / "ingest", folder / "out"))


def diagnosed(rig: Rig, folder: Path) -> str:
    """Return verdict and what is missing, or how the stage ended."""
    answer = looked_at(rig, folder)
    path, out = folder / "pipeline.toml", folder / "out"
    (out / "diagnose").mkdir()
    try:
        found = diagnose.run(Context(path, load(path), out / "diagnose", out, answers={"ingest": answer}))
    except Exception as error:  # noqa: BLE001 - whatever it is, the table says it
        return f"{type(error).__name__}: {error}".split("\n")[0]
    return f"{found['verdict']} {' '.join(found['missing'])}".strip()


def table(*, with_diagnosis: bool) -> Iterator[str]:
    """Yield the lines of the table in Markdown."""
    yield "| false data set | found | " + ("diagnose |" if with_diagnosis else "")
    yield "| --- | --- | " + ("--- |" if with_diagnosis else "")
    for name, one in SETS.items():
        with tempfile.TemporaryDirectory() as folder:
            found = looked_at(one.make(), Path(folder))["plausibility"]
        if with_diagnosis and one.named:
            with tempfile.TemporaryDirectory() as folder:
                verdict = f" {diagnosed(one.make(), Path(folder))} |"
        else:
            verdict = " |" if with_diagnosis else ""
        seen = {(f["check"], f["signal"]): f["found"] for f in found}
        hits = seen.keys() & one.expected
        text = "; ".join(f"`{check}` {signal}" + (f" ({seen[check, signal]})" if (check, signal) in hits else "") for check, signal in seen)
        yield f"| {name} | {text or 'NOTHING'}{'' if hits else ' NOT AS EXPECTED'} |{verdict}"


if __name__ == "__main__":
    for line in table(with_diagnosis="--diagnose" in sys.argv[1:]):
        print(line, flush=True)
