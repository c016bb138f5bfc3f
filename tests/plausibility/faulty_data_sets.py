"""False but well-formed data sets, each made of good recordings by one mistake."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.config import load
from pneucli.pipeline.graph import Context
from pneucli.stages import ingest

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
        text = _with_recordings(text, lambda table: any(f'name = "{name}"' in table for name in names))
        for name, stated_noise in NOISES.items() if noise else ():
            text = text.replace(f"\n{name} = {{ ", f'\n{name} = {{ noise = "{stated_noise}", ')
        return cls(text, {name: _read(FIXTURES / folder / f"{name}.csv") for name in names})

    def write(self, folder: Path) -> Path:
        """Write all files and return the pipeline file's path."""
        for name, columns in self.recordings.items():
            rows = np.column_stack(list(columns.values()))
            header = ",".join(columns)
            np.savetxt(folder / f"{name}.csv", rows, "%.9g", ",", header=header, comments="")
        (folder / "pipeline.toml").write_text(self.text)
        return folder / "pipeline.toml"


def _with_recordings(text: str, wanted: Callable[[str], bool]) -> str:
    head, *tables = text.partition("[model]")[0].split("[[recordings]]")
    kept = "[[recordings]]".join([head, *filter(wanted, tables)])
    return f"{kept}[model]{text.partition('[model]')[2]}"


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


def noisy(name: str, mean: float, std: float, only: str = "") -> Mistake:
    """A column of nothing but noise."""

    def change(c: Columns, rng: np.random.Generator) -> Columns:
        return c | ({name: mean + std * rng.standard_normal(c[T].size)} if name in c else {})

    return columns(change, only)


def held(name: str, value: float, only: str = "") -> Mistake:
    """A column that says the same all along."""
    return noisy(name, value, 0.0, only)


def swapped(first: str, second: str, only: str = "") -> Mistake:
    def change(c: Columns, rng: np.random.Generator) -> Columns:
        return c | ({first: c[second], second: c[first]} if {first, second} <= c.keys() else {})

    return columns(change, only)


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


def without(name: str) -> Mistake:
    """No mistake: a recording fewer."""
    return lambda rig: replace(rig, text=_with_recordings(rig.text, lambda table: f'name = "{name}"' not in table))


def absolute_as_gauge(*names: str) -> Mistake:
    return scaled(1.0, *names, plus=1.013)


def _holes(c: Columns, rng: np.random.Generator) -> Columns:
    return c | {P1: np.where(rng.random(c[P1].size) < 0.5, np.nan, c[P1])}


def _cable(c: Columns, rng: np.random.Generator) -> Columns:
    rows = np.arange(c[X].size)
    return c | {X: np.where((rows > 0.3 * rows.size) & (rows < 0.6 * rows.size), np.nan, c[X])}


def readings(name: str, change: Callable[[Array], Array], only: str = "") -> Mistake:
    """A fault of the sensor or the logger in the numbers of one column."""
    return columns(lambda c, rng: c | {name: change(c[name].copy())} if name in c else c, only)


def _clipped(values: Array) -> Array:
    return np.minimum(values, np.quantile(values, 0.8))


def _with_spikes(values: Array) -> Array:
    values[50::500] += 3.0 * np.ptp(values)
    return values


def _marked(values: Array) -> Array:
    for start in (300, 700, 1100):
        values[start : start + 12] = -9999.0
    return values


def _stuck(values: Array) -> Array:
    values[500:700] = values[500]
    return values


def times(key: str, factor: float) -> Mistake:
    """A value of the rig, off by a factor."""

    def make(rig: Rig) -> Rig:
        found = re.search(rf'{key} = "([\d.]+) ', rig.text)
        assert found
        return replace(rig, text=rig.text.replace(found[0], f'{key} = "{factor * float(found[1]):.6g} '))

    return make


@dataclass(frozen=True)
class FalseSet:
    """One mistake on one rig, and (check, signal) of all that is to be found at least."""

    base: str
    mistake: Mistake
    expected: set[tuple[str, str]]

    def make(self, *, noise: bool = False) -> Rig:
        return self.mistake(Rig.of(self.base, noise=noise))


def _sets(base: str, rows: dict[str, tuple[Mistake, str]]) -> dict[str, FalseSet]:
    """Read ``"check signal & check signal"``."""
    sets = {}
    for name, (mistake, expected) in rows.items():
        pairs = {(check, signal) for check, signal in (each.split() for each in expected.split("&"))}
        sets[f"{base}, {name}"] = FalseSet(base, mistake, pairs)
    return sets


FIVE = columns(lambda c, rng: {n: values[:5] for n, values in c.items()})
LARGE = both(times("piston_area_1", 100), times("piston_area_2", 100))
SMALL = both(times("piston_area_1", 0.01), times("piston_area_2", 0.01))
MS_AS_S = stated(r'"t \[ms\]", unit = "ms"', '"t [ms]", unit = "s"')
DRIVEN = without("stickslip_2")
S_AS_MS = scaled(1e-3, T)
MM_AS_M = stated(r'"Pos \[mm\]", unit = "mm"', '"Pos [mm]", unit = "m"')
TURNED = scaled(-1.0, X, plus=200.0)


# friction: stick-slip with an open chamber 2, driven motion with a closed one; valve: charge and discharge of a vessel;
# axis: the valve on its bench, then a 5/3 valve on both chambers
SETS = {
    **_sets(
        "friction",
        {
            "p1 dead": (held(P1, 1.5), "silent p1"),
            "p1 nothing but noise": (noisy(P1, 2.0, 0.5), "silent p1"),
            "p1 and p2 swapped": (swapped(P1, P2), "direction x & swapped p1"),
            "5 samples": (FIVE, "samples p1"),
            "half of p1 missing": (columns(_holes), "missing p1"),
            "cable of x loose": (columns(_cable), "missing x"),
            "gauge read as absolute": (read_as_absolute("p1", "p2"), "reference p2"),
            "absolute read as gauge": (absolute_as_gauge(P1, P2), "reference p2"),
            "gauge read as absolute, closed": (both(DRIVEN, read_as_absolute("p1", "p2")), "reference p2"),
            "absolute read as gauge, closed": (both(DRIVEN, absolute_as_gauge(P1, P2)), "reference p2"),
            "p2 alone gauge read as absolute": (read_as_absolute("p2"), "reference p2"),
            "recorded at 10 Hz": (thinned(100), "sampling time"),
            "areas 100 times too large": (LARGE, "mass x"),
            "areas 100 times too small": (SMALL, "mass x & volume p2"),
            "mass in g stated as kg": (times("moving_mass", 1000), "mass x"),
            "mass in t stated as kg": (times("moving_mass", 1e-3), "mass x"),
            "x inverted": (scaled(-1.0, X), "direction x & direction a"),
            "x inverted from the other end": (TURNED, "direction x & direction a"),
            "x and a inverted": (both(scaled(-1.0, A), TURNED), "direction x"),
            "mm declared as m": (MM_AS_M, "stroke x"),
            "m declared as mm": (scaled(1e-3, X), "derivative a & volume p2"),
            "ms declared as s": (MS_AS_S, "derivative a"),
            "s declared as ms": (S_AS_MS, "speed x & derivative a"),
            "x dead": (held(X, 100.0), "motionless x"),
            "x nothing but noise": (noisy(X, 100.0, 0.01), "motionless x"),
            "x dead in one recording": (held(X, 100.0, "driven_2"), "motionless x"),
            "a dead": (held(A, 0.0), "silent a"),
            "a nothing but noise": (noisy(A, 0.0, 1.0), "silent a"),
            "a inverted": (scaled(-1.0, A), "direction a"),
            "a in g": (scaled(1 / 9.81, A), "derivative a"),
            "kPa declared as bar": (scaled(100.0, P1, P2), "unit p1"),
            "MPa declared as bar": (scaled(0.1, P1, P2), "mass x"),
            "psi declared as bar": (scaled(14.504, P1, P2), "unit p1"),
            "one column for p1 and p2": (columns(lambda c, rng: c | {P2: c[P1]}), "copy p2"),
            "p2 of the closed chamber dead": (held(P2, 2.0, "driven"), "silent p2"),
            "x from another zero": (scaled(1.0, X, plus=-150.0), "stroke x"),
            "stroke in cm": (times("stroke", 0.1), "stroke x"),
            "dead volume in l": (times("dead_volume_2", 1000), "volume p2"),
            "p1 at the end of its range": (readings(P1, _clipped), "saturated p1"),
            "p1 with spikes": (readings(P1, _with_spikes), "spike p1"),
            "p2 with marks of no value": (readings(P2, _marked), "mark p2"),
            "p1 stuck for a while": (readings(P1, _stuck), "frozen p1"),
            "p1 sampled at a tenth of the rate": (readings(P1, lambda p: np.repeat(p[::10], 10)[: p.size]), "held p1"),
            "x loses counts": (readings(X, lambda x: x - 60.0 * (np.arange(x.size) > 900), "driven"), "speed x"),
            "x from a counter of 100 mm": (readings(X, lambda x: np.mod(x, 100.0)), "roll-over x"),
        },
    ),
    **_sets(
        "valve",
        {
            "p1 dead": (held(P1, 3.0), "silent p1"),
            "p1 nothing but noise": (noisy(P1, 3.0, 0.5), "silent p1"),
            "p1 dead in one recording": (noisy(P1, 0.0, 0.004, "step_+10"), "silent p1"),
            "p1 and p_supply swapped": (swapped(P1, PS), "swapped p1"),
            "5 samples": (FIVE, "samples p1"),
            "half of p1 missing": (columns(_holes), "missing p1"),
            "vessel 1000 times too large": (times("volume", 1000), "volume p1"),
            "vessel 1000 times too small": (times("volume", 1e-3), "volume p1"),
            "gauge read as absolute": (read_as_absolute("p1", "p_supply"), "reference p1"),
            "absolute read as gauge": (absolute_as_gauge(P1, PS), "reference p1"),
            "p_supply alone gauge read as absolute": (read_as_absolute("p_supply"), "reference p_supply"),
            "p_supply dead": (held(PS, 0.0), "supply p_supply"),
            "ms declared as s": (MS_AS_S, "volume p1"),
            "s declared as ms": (S_AS_MS, "volume p1"),
            "u dead": (held(U, 0.0), "silent u"),
            "u another signal": (noisy(U, 0.0, 3.0), "silent u"),
            "u inverted": (scaled(-1.0, U), "direction u"),
            "mV declared as V": (scaled(1000.0, U), "unit u"),
            "p1 in kPa declared as bar": (scaled(100.0, P1), "unit p1 & supply p_supply"),
            "p1 a tenth": (scaled(0.1, P1), "supply p_supply"),
            "p_supply a tenth": (scaled(0.1, PS), "supply p_supply"),
            "recorded at 5 Hz": (thinned(200), "sampling time"),
        },
    ),
    **_sets(
        "axis",
        {
            "p1 dead": (held(P1, 3.0, "axis"), "silent p1"),
            "x inverted": (TURNED, "direction x"),
            "p1 and p2 swapped": (swapped(P1, P2, "axis"), "direction x"),
            "p1 and p_supply swapped": (swapped(P1, PS, "axis"), "swapped p1"),
            "areas 100 times too large": (LARGE, "volume p1"),
            "vessel 1000 times too large": (times("volume", 1000), "volume p1"),
            "vessel 30 times too large": (times("volume", 30), "volume p1"),
            "gauge read as absolute": (read_as_absolute("p_supply", "p1", "p2"), "reference p1"),
            "u inverted": (scaled(-1.0, U, only="axis"), "direction u"),
            "x dead": (held(X, 100.0), "motionless x"),
            "recorded at 10 Hz": (thinned(100), "sampling time"),
        },
    ),
}


# what an effect of the catalogue explains: payload, offset, scale, delay, bias, volume; and what is no mistake
EXPLAINED = {
    "friction, payload of twice the mass": ("friction", times("moving_mass", 1 / 3)),
    "friction, offset of p1": ("friction", scaled(1.0, P1, plus=0.1)),
    "friction, scale of the pressures": ("friction", scaled(1.06, P1, P2)),
    "friction, pressures 5 ms late": ("friction", columns(lambda c, rng: c | {n: np.roll(c[n], 5) for n in (P1, P2)})),
    "friction, bias of a": ("friction", scaled(1.0, A, plus=0.5)),
    "valve, offset of p1": ("valve", scaled(1.0, P1, plus=-0.1)),
    "valve, vessel twice as large": ("valve", times("volume", 2)),
    "valve, null at 5 V": ("valve", scaled(1.0, U, plus=5.0)),
    "axis, dead volume half as large": ("axis", times("dead_volume_1", 0.5)),
    "axis, scale of the pressures": ("axis", scaled(0.94, P1, P2)),
}


def looked_at(rig: Rig, folder: Path) -> dict[str, Any]:
    """Return the answer of ``ingest``."""
    path = rig.write(folder)
    return ingest.run(Context(path, load(path), folder / "out" / "ingest", folder / "out"))


def told(answer: dict[str, Any]) -> set[tuple[str, str]]:
    """Return the guards that spoke in an answer of ``ingest``, each with its signal."""
    return {(one["check"], one["signal"]) for one in answer["plausibility"]} | {
        (one["kind"], one["signal"]) for one in answer["repairs"]
    }
