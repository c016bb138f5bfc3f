"""How does the diagnosis answer on rigs by another hand? ``python -m benchmarks.world DIR --seed N [--ask]``

Virtual servo-pneumatic axes with a truth, of which the program knows nothing: the physics of ``benchmarks.axis``, read
by sensors with filter, noise, offset and quantisation.

Families: ``gantry`` (rodless, 0.5-1.2 m), ``press`` (vertical, differential), ``clamp`` (small, 5/3 or two 3/2 valves)
and ``fast`` (short stroke, hardly damped). Sizes are those of catalogues: valves of 100 to 2000 l/min and 40 to 150 Hz,
cylinders after ISO 15552 and ISO 6432. Of five cases in a row two have a hidden effect, one has two, one is healthy and
one has a fault outside the catalogue. A hidden effect is scaled until it explains 5 to 60 % of the squared residual
that a textbook model with fitted parameters leaves in the channel in which it shows best.

``--ask`` diagnoses each case and prints a row: truth, names with probability, hidden effects in the answer, exactly
these, false and mild names, error over noise before and after, processor seconds; then the counts of each family.
"""

import argparse
import itertools
import json
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from benchmarks.axis import (
    AREA,
    COARSE_STEP,
    FAMILIES,
    GRAVITY,
    HORIZON,
    MACHINES,
    PAIRS,
    RIG,
    SOUND,
    STEP,
    Array,
    Record,
    at_rest,
    between,
    gains_of,
    healthy_rig,
    natural_frequency,
    pick,
    programme,
    record,
    replay,
)
from benchmarks.cases import Counts, judged, own_program, truth_of
from benchmarks.score import essence, measured

VISIBLE, SIZES = (0.05, 0.6), (0.3, 2.0)  # shares of a residual that are sought; scales of a drawn size
KINDS = (1, 0, 2, 1, -1)  # number of hidden effects; -1: a fault outside the catalogue


@dataclass(frozen=True)
class Change:
    """How an effect changes a field of the rig: a draw between ``low`` and ``high``, times a reference.

    ``how``: added to the healthy value, times it, in its place, or "either" way. ``grows``: whether the search for a
    visible size may scale it. ``parameter``: of the catalogue, with the factor from field to unit.
    """

    name: str
    low: float
    high: float
    of: str = "one"
    parameter: str = ""
    index: int | None = None
    how: str = "add"
    grows: bool = True
    factor: float = 1.0
    tolerance: float = 0.2  # of the parameter: what the catalogue's simpler equation may find instead
    null: float | None = None  # where it is not the healthy value


def leak(name: str, index: int | None = None) -> Change:
    return Change(name, 0.006, 0.025, "conductance", "area", index, factor=1.0 / AREA)


EFFECTS: dict[str, tuple[Change, ...]] = {
    "chamber-leak": (leak("leak", 0),),
    "chamber-leak:2": (leak("leak", 1),),
    "piston-leak": (leak("pleak"),),
    "valve-leak": (leak("C_leak"),),
    "dead-volume": (Change("V0", 0.04, 0.12, "swept", "volume_added", 0),),
    "dead-volume:2": (Change("V0", 0.04, 0.12, "swept", "volume_added", 1),),
    "supply-droop": (
        Change("Greg", 0.1, 0.4, "healthy", "regulator_conductance", how="set", grows=False, tolerance=0.35),
        Change("Vb", 2e-4, 1e-3, "one", "vessel_volume", how="set", grows=False, tolerance=0.35),
    ),
    "line-delay": (Change("L", 0.6, 1.3, "hose", "delay", factor=1.0 / SOUND, tolerance=0.5),),
    "valve-lag": (Change("tau_v", 0.6, 1.3, "lag", "time_constant", tolerance=0.3),),
    "valve-hysteresis": (Change("play", 0.008, 0.02, "one", "half_width"),),
    "friction-asymmetry": (
        Change("asym", 0.15, 0.4, "one", "asymmetry", how="either"),
        Change("vasym", 0.1, 0.3, "one", "viscous_asymmetry", how="either", tolerance=0.4),
    ),
    "pressure-friction": (Change("pgain", 0.05, 0.12, "one", "gain"),),
    "position-friction": (
        Change("x_from", 0.1, 0.45, "stroke", "from", how="set", grows=False),
        Change("x_to", 0.6, 0.85, "stroke", "to", how="set", grows=False),
        Change("x_gain", 0.5, 1.2, "one", "gain", tolerance=0.3),
    ),
    "constant-force": (Change("force", 0.1, 0.35, "weight", "force", how="either", null=0.0),),
    "spring-force": (
        Change("spring", 1.5, 5.0, "spring", "stiffness"),
        Change("spring_x", 0.0, 1.0, "stroke", "rest_position", how="set", grows=False),
    ),
    "extra-mass": (Change("mass", 0.3, 0.8, "mass", "mass"),),
    "end-cushion": (
        Change("cush_len", 0.08, 0.2, "stroke", "length", how="set", grows=False),
        Change("cush", 1.0, 3.0, "damper", "damping", how="set", tolerance=0.25),
    ),
    "dwell-breakaway": (
        Change("dwell", 0.5, 1.2, "one", "gain", tolerance=0.4),
        Change("dwell_tau", 0.2, 1.0, "one", "time_constant", how="set", grows=False, tolerance=0.6),
    ),
    "friction-hysteresis": (Change("drop", 0.15, 0.3, "one", "drop", tolerance=0.35),),
    "presliding": (Change("presl", 1.5e-4, 3e-4, "one"),),
    "stribeck": (Change("Fs", 0.4, 0.9, "coulomb", "static", null=1.0),),
    "heat-transfer": (Change("h0", 1.0, 1.0, "healthy", how="set", grows=False, null=0.0),),
    "critical-ratio": (
        Change("b_s", 1.0, 1.0, "healthy", how="set", grows=False, null=0.528),
        Change("b_e", 1.0, 1.0, "healthy", how="set", grows=False, null=0.528),
    ),
    "pressure-offset": (Change("off", 3e3, 9e3, "one", "offset", 0, how="either", grows=False),),
    "pressure-offset:2": (Change("off", 3e3, 9e3, "one", "offset", 1, how="either", grows=False),),
    "pressure-scale": (Change("scale", 0.03, 0.06, "one", "scale", how="either", grows=False, tolerance=0.01),),
    "pressure-lag": (Change("tau_p", 0.6, 1.3, "lag", "time_constant", grows=False),),
    "time-skew": (Change("skew", 0.6, 1.3, "lag", "delay", grows=False, tolerance=0.3),),
}
UNKNOWN: dict[str, tuple[Change, ...]] = {
    "payload on an elastic mount": (
        Change("m_load", 0.4, 0.7, "mass", how="set", grows=False),
        Change("k_load", 1.5, 5.0, "mount", how="set", grows=False),
        Change("c_load", 0.02, 0.06, "damper", how="set", grows=False),
    ),
    "supply pulsates": (Change("pulse", 1.5e4, 4e4),),
    "guide is wavy": (Change("wave", 0.25, 0.45), Change("wave_len", 0.06, 0.15, "stroke", how="set", grows=False)),
    "valve differs from recording to recording": (Change("drift", 0.05, 0.12),),
    "scale of position": (Change("x_scale", 0.03, 0.06, how="either", grows=False),),
    "pressure sensors talk across": (Change("cross", 0.03, 0.08, grows=False),),
}
ALWAYS_MODELLED = ("stribeck", "heat-transfer", "critical-ratio")
UNLOGGED_SUPPLY = {"supply-droop", "supply pulsates"}
ALIKE = ({"line-delay", "valve-lag"}, {"pressure-lag", "time-skew"}, {"chamber-leak", "chamber-leak:2", "piston-leak"},
         {"stribeck", "friction-hysteresis", "dwell-breakaway"}, {"pressure-offset", "pressure-offset:2"})  # fmt: skip
UNSEEN = {"off", "scale", "skew", "x_scale", "cross"}  # fields of sensors alone, which a replay does not have


@dataclass
class Fault:
    """One fault of a rig: its drawn sizes, their common scale, and the share of the residual that it explains."""

    name: str
    draws: Array
    size: float = 1.0
    share: float | None = None

    @property
    def changes(self) -> tuple[Change, ...]:
        """What it changes."""
        return EFFECTS.get(self.name) or UNKNOWN[self.name]


def drawn_faults(kind: int, rng: Generator, *, of_sensors: bool) -> list[Fault]:
    """Return the faults of a rig, two of them not alike; with or without those of sensors alone."""
    catalogue = UNKNOWN if kind < 0 else EFFECTS
    choices = [name for name, changes in catalogue.items() if of_sensors or changes[0].name not in UNSEEN]
    while True:
        names = [str(name) for name in rng.choice(choices, abs(kind), replace=False)]
        if not any(len(group & set(names)) > 1 for group in ALIKE):
            return [Fault(name, rng.random((3, 2))) for name in names]


def reference(r: Record, change: Change) -> float:
    """Return what a size is relative to."""
    lag = 0.003 + 0.12 / natural_frequency(r)
    return float(
        {
            "one": 1.0,
            "healthy": np.mean(r[change.name]),
            "conductance": np.mean(r.C_s),
            "swept": r.A[0] * r.stroke,
            "stroke": r.stroke,
            "hose": SOUND * lag,
            "lag": lag,
            "mass": r.mass,
            "weight": r.mass * GRAVITY,
            "coulomb": r.Fc,
            "spring": r.Fs / r.stroke,
            "damper": r.mass * natural_frequency(r),
            "mount": r.mass * natural_frequency(r) ** 2,
        }[change.of]
    )


def faulty(healthy: Record, faults: Sequence[Fault], leans: float) -> Record:
    """Return a rig with faults; the weight of a payload on a vertical axis acts as well."""
    rigs = healthy.copy()
    for fault in faults:
        for change, (draw, side) in zip(fault.changes, fault.draws, strict=False):
            amount = (change.low + (change.high - change.low) * draw) * reference(healthy[0], change)
            amount *= fault.size if change.grows else 1.0
            sign = -1.0 if change.how == "either" and side < 0.5 else 1.0
            where = slice(None) if change.index is None else slice(change.index, change.index + 1)
            values = np.atleast_1d(rigs[change.name][0])
            values[where] = amount if change.how == "set" else values[where] + sign * amount
            rigs[change.name][0] = values if change.name in PAIRS.split() else values[0]
    if healthy["force"][0] != 0.0:
        rigs["force"] += leans * GRAVITY * (rigs["mass"] - healthy["mass"])
    return rigs


def without(rigs: Record, healthy: Record, fault: Fault) -> Record:
    """Return a rig without one of its faults."""
    bare = rigs.copy()
    for change in fault.changes:
        bare[change.name] = healthy[change.name] if change.null is None else change.null
    if fault.name == "stribeck":
        bare["Fs"] = rigs["Fc"]
    bare["V0"] += 0.25 * np.pi * rigs["D"][0] ** 2 * (rigs["L"] - bare["L"])  # the stated volume has the whole hose
    return bare


def parameters_of(fault: Fault, rigs: Record, healthy: Record, full: float) -> dict[str, list[float]]:
    """Return by parameter of the catalogue the interval that is right."""
    out = {}
    for change in fault.changes:
        if change.parameter:
            of_field = rigs[change.name][0] - (healthy[change.name][0] if change.name in ("V0", "mass") else 0.0)
            value = change.factor * float(np.max(of_field) if change.index is None else of_field[change.index])
            value *= full if change.name == "play" else 1.0
            around = change.tolerance * abs(value)
            out[change.parameter] = [value - around, value + around]
    return out


@dataclass
class Run:
    """One recording: its true samples, and from where a replay goes on."""

    kind: str
    use: str
    closed: bool
    rig: Record
    reference: Array
    out: Array
    anchors: Record


def drifted(rigs: Record, k: int) -> Record:
    """Return the rig in its k-th recording."""
    found = rigs.copy()
    for name in ("C_s", "C_e"):
        found[name] *= 1.0 + rigs["drift"][0] * (-1.0) ** k * (1.0 - 0.3 * (k % 3))
    return found


Plan = Sequence[tuple[str, str, float]]  # kind, use and seconds of each recording


def recordings(rigs: Record, rest: Mapping[str, Any], plan: Plan, seed: Sequence[int], step: float) -> list[Run]:
    """Return the recordings of a plan. Before each the axis is brought to its start and rests."""
    runs, r, period = [], rigs[0], 1.0 / rest["rate"]
    ends = (-1.0, 2.0) if rest["into_stops"] else (0.12 * r.stroke, 0.88 * r.stroke)
    for k, (kind, use, seconds) in enumerate(plan):
        rng, mine = np.random.default_rng([*seed, k]), drifted(rigs, k)
        first, second, closed = programme(kind, r, rest, rng, int(seconds * rest["rate"]))
        start = min(max(first[0], 0.0), r.stroke) if closed else r.stroke * rng.uniform(0.3, 0.7)
        state, gains, steps = at_rest(r, start), gains_of(r, rest), round(period / step)
        still = np.full(2 * rest["rate"], start)
        record(mine, state, still, np.full(still.size, rest["prefill"]), True, gains, ends, period, steps)
        out, anchors = record(mine, state, first, second, closed, gains, ends, period, steps)
        runs.append(Run(kind, use, closed, mine, first, out, anchors))
    return runs


NUISANCES = {"C_s": 1.05, "C_e": 1.05, "b_s": 1.1, "b_e": 1.1, "Fc": 1.1, "Fs": 1.1, "visc": 1.1, "h0": 1.2,
             "ov_s": 1.1, "ov_e": 1.1, "force": 1.1}  # what a fit of a textbook model adapts  # fmt: skip


def textbook(rigs: Record, stated: Mapping[str, Any]) -> Record:
    """Return the rig as a textbook model has it: hardly a hose, an immediate spool, rigid seals, stated volumes."""
    plain, r = rigs.copy(), rigs[0]
    plain["L"] = np.maximum(0.3 * r.L, np.minimum(r.L, 0.12))
    plain["V0"] += 0.25 * np.pi * r.D**2 * (r.L - plain["L"]) + stated["volume_error"]
    plain["omega"], plain["rate"], plain["play"], plain["tau_p"] = 2500.0, 1e4, 0.0, 1e-5
    plain["presl"], plain["C_leak"], plain["pgain"], plain["null"] = 0.25 * r.presl, 0.0, 0.0, 0.0
    return plain


class Fit:
    """What a fitted textbook model leaves of the recordings (in units of 20 um and of the noise of a pressure).

    The fit is linear, in the parameters of ``NUISANCES``, about the true rig.
    """

    def __init__(self, healthy: Record, runs: Sequence[Run], stated: Mapping[str, Any]) -> None:
        self.runs, self.stated = runs, stated
        base = self.replayed()
        moved = [(self.replayed({name: by}) - base).ravel() for name, by in NUISANCES.items()]
        self.tangents = np.linalg.qr(np.stack([one / np.linalg.norm(one) for one in moved if one.any()], axis=1))[0]
        rest = self.unfitted(self.replayed(whole=textbook(healthy, stated)), self.replayed(whole=healthy))
        self.power = np.mean(rest**2, axis=0) + 1.0

    def replayed(self, change: Mapping[str, float] | None = None, whole: Record | None = None) -> Array:
        """Return the channels (n, 3) by a rig in place of the true one, or by the true one with changed fields."""
        parts = []
        for run in self.runs:
            mine = (run.rig if whole is None else whole).copy()
            for name, factor in (change or {}).items():
                mine[name] *= factor
            parts.append(replay(mine, run.anchors[:1].copy(), run.out, run.anchors, 1.0 / self.stated["rate"], 4)[::5])
        return np.concatenate(parts) / np.array([20e-6, self.stated["noise"], self.stated["noise"]])

    def unfitted(self, found: Array, base: Array) -> Array:
        """Return what the fit leaves of a difference."""
        off = (found - base).ravel()
        return (off - self.tangents @ (self.tangents.T @ off)).reshape(base.shape)

    def share(self, fault: Fault, rigs: Record, healthy: Record, runs: Sequence[Run]) -> float | None:
        """Return the share of the squared residual that a fault explains; None for a fault of sensors alone.

        It is that of the channel with the largest, in recordings of the same plan.
        """
        if any(change.name in UNSEEN for change in fault.changes):
            return None
        self.runs = runs
        missed = self.unfitted(self.replayed(whole=without(rigs, healthy, fault)), self.replayed())
        power = np.mean(missed**2, axis=0)
        return float(np.max(power / (power + self.power)))


@dataclass
class Built:
    """A case before it is written."""

    healthy: Record
    rigs: Record
    stated: dict[str, Any]
    faults: list[Fault]
    runs: list[Run] = field(default_factory=list)


def is_visible(case: Built, plan: Plan, seed: Sequence[int]) -> bool:
    """Scale the faults of a case until each explains a share as it is sought; whether that was possible."""
    fit = None
    for attempt in range(3):
        case.rigs = faulty(case.healthy, case.faults, case.stated["leans"])
        runs = recordings(case.rigs, case.stated, plan, seed, COARSE_STEP)
        fit = fit or Fit(case.healthy, runs, case.stated)
        for fault in case.faults:
            fault.share = fit.share(fault, case.rigs, case.healthy, runs)
        off = [f for f in case.faults if f.share is not None and not VISIBLE[0] <= f.share <= VISIBLE[1]]
        if not off:
            return True
        for fault in off if attempt < 2 else ():
            grown = fault.size * np.sqrt(0.25 / max(fault.share or 0.0, 1e-3))
            fault.size = float(np.clip(grown, *SIZES))
    return False


def built(family: str, kind: int, seed: Sequence[int], seconds: tuple[float, float] | None) -> Built:
    """Return a rig with faults that show and its recordings; faults that cannot be scaled to show give way to others.

    The last of several is kept in any case: its share stands in the truth.
    """
    rng = np.random.default_rng(seed)
    healthy, stated = healthy_rig(family, rng)
    others = list(rng.choice(["sine", "slow", "ramp", "reversals"], rng.integers(1, 4), replace=False))
    kinds = [("moves", "train"), ("steps", "train"), *((one, "train") for one in others)]
    kinds += [(pick(rng, ("moves", "steps")), "test")]
    plan = [(str(one), use, between(rng, seconds or MACHINES[family].seconds)) for one, use in kinds]
    for attempt in range(5):  # faults of sensors are not judged: they are no second choice
        case = Built(healthy, healthy, stated, drawn_faults(kind, rng, of_sensors=attempt == 0))
        if not case.faults or is_visible(case, plan[:3], seed):
            break
    case.runs = recordings(case.rigs, stated, plan, seed, STEP)
    return case


def sensed(run: Run, stated: Mapping[str, Any], rng: Generator) -> Array:
    """Return what the sensors read (n, 4): x, both pressures and the supply's, absolute."""
    r, n, step = run.rig[0], len(run.out), 10e5 / 2 ** stated["bits"]
    gauge = run.out[:, 1:3] - r.pamb
    p = r.pamb + r.scale * gauge + r.cross * gauge[:, ::-1] + r.off
    late = np.arange(n) - r.skew * stated["rate"]
    p = np.column_stack([*(np.interp(late, np.arange(n), one) for one in p.T), run.out[:, 3]])
    p += stated["noise"] * rng.standard_normal(p.shape)
    encoder = stated["encoder"]
    x = encoder * np.floor(r.x_scale * run.out[:, 0] / encoder + 0.3 * rng.standard_normal(n))
    return np.column_stack([x, r.pamb + step * np.round((p - r.pamb) / step)])


STYLES: tuple[dict[str, Any], ...] = (  # how recorders write: column, unit, factor to SI, decimals
    {"time": ("t [s]", "s", 1.0, 5), "x": ("x [mm]", "mm", 1e-3, 4), "p": ("p{} [bar]", "bar", 1e5, 5),
     "u": ("u{} [V]", "V", 1.0, 4), "separator": ",", "reference": "gauge"},
    {"time": ("Time_ms", "ms", 1e-3, 2), "x": ("Pos_um", "um", 1e-6, 1), "p": ("P{}_kPa", "kPa", 1e3, 3),
     "u": ("Y{}_V", "V", 1.0, 4), "separator": ";", "reference": "gauge"},
    {"time": ("time_us", "us", 1e-6, 0), "x": ("pos_m", "m", 1.0, 7), "p": ("p{}_mbar", "mbar", 1e2, 2),
     "u": ("valve{}", "V", 1.0, 4), "separator": ",", "reference": "absolute"},
)  # fmt: skip


def columns_of(stated: Mapping[str, Any]) -> dict[str, tuple[Any, ...]]:
    """Return by signal its column, unit, factor to SI and decimals."""
    style, found = STYLES[stated["style"]], {}
    for signal, like, mark in (("time", "time", ""), ("u", "u", 1), ("u2", "u", 2), ("x_ref", "x", ""), ("x", "x", ""),
                               ("p1", "p", 1), ("p2", "p", 2), ("p_supply", "p", "S")):  # fmt: skip
        column, *rest = style[like]
        found[signal] = ("set_" * (signal == "x_ref") + column.format(mark), *rest)
    logged = {"u2": stated["two"], "x_ref": stated["setpoint_logged"], "p_supply": stated["supply_logged"]}
    return {signal: column for signal, column in found.items() if logged.get(signal, True)}


def write_recording(path: Path, run: Run, stated: Mapping[str, Any], rng: Generator) -> None:
    """Write the CSV of one recording; a reference is written where a loop closes."""
    x, p1, p2, supply = sensed(run, stated, rng).T
    volts = stated["null"] + stated["full"] * run.out[:, 4:]
    values = {"time": np.arange(len(x)) / stated["rate"], "u": volts[:, 0], "u2": volts[:, 1], "x_ref": run.reference,
              "x": x, "p1": p1, "p2": p2, "p_supply": supply}  # fmt: skip
    style, columns = STYLES[stated["style"]], columns_of(stated)
    if not run.closed:
        columns.pop("x_ref", None)
    ambient = dict.fromkeys(("p1", "p2", "p_supply"), run.rig[0].pamb if style["reference"] == "gauge" else 0.0)
    table = np.column_stack([(values[n] - ambient.get(n, 0.0)) / columns[n][2] for n in columns])
    head = style["separator"].join(one[0] for one in columns.values())
    np.savetxt(path, table, [f"%.{one[3]}f" for one in columns.values()], style["separator"], header=head, comments="")


def pipeline_of(name: str, case: Built) -> str:
    """Return the text of the pipeline file, with what its author knows of the rig."""
    h, stated, style = case.healthy[0], case.stated, STYLES[case.stated["style"]]
    hose = 0.25 * np.pi * h.D**2 * case.rigs[0].L + h.Vport
    dead = 1e6 * (h.V0 + stated["volume_error"] + hose)
    lines = ["[pipeline]", f'name = "{name}"', "", "[rig]", f'gas_temperature = "{h.Ta:.0f} K"']
    lines += [f'ambient_pressure = "{h.pamb / 1e5:.3f} bar"', f'supply_pressure = "{round(h.pset / 5e3) / 20:.2f} bar"']
    lines += ["", "[rig.cylinder]", *(f'piston_area_{i} = "{1e4 * h.A[i - 1]:.4f} cm^2"' for i in (1, 2))]
    lines += [f'stroke = "{1e3 * h.stroke:.0f} mm"', *(f'dead_volume_{i} = "{dead[i - 1]:.2f} cm^3"' for i in (1, 2))]
    lines += [f'moving_mass = "{h.mass * (1 + stated["mass_error"]):.3f} kg"', "", "[rig.valve]"]
    lines += [f'arrangement = "{"two" if stated["two"] else "5/3"}"', f'null = "{stated["null"]:g} V"', "", "[signals]"]
    for signal, (column, unit, *_) in columns_of(stated).items():
        more = f', reference = "{style["reference"]}"' if signal.startswith("p") else ""
        more += ", optional = true" if signal == "x_ref" else ""
        lines.append(f'{signal} = {{ column = "{column}", unit = "{unit}"{more} }}')
    for k, run in enumerate(case.runs):
        loop = run.closed and stated["setpoint_logged"]
        lines += ["", "[[recordings]]", f'name = "{k + 1}_{run.kind}"', f'file = "raw/{k + 1}_{run.kind}.csv"']
        lines += [f'experiment = "{"closed-loop" if loop else "axis"}"', *(['controller = "unknown"'] if loop else [])]
        lines += [f'use = "{run.use}"', 'chamber_2 = "valve"']
    modelled = ", ".join(f'"{one}"' for one in modelled_effects(case))
    lines += ["", "[model]", f"effects = [{modelled}]", "", "[compare]", f'horizon = "{HORIZON} s"', ""]
    return "\n".join(lines)


def modelled_effects(case: Built) -> list[str]:
    """Return the effects of the pipeline's model: those of every rig, and the weight of a vertical axis."""
    hidden = {fault.name for fault in case.faults}
    weight = ["constant-force"] if case.healthy[0].force != 0.0 else []
    return [one for one in (*ALWAYS_MODELLED, *weight) if one not in hidden]


def truth(case: Built) -> dict[str, Any]:
    """Return what is true of a case."""
    r, h, stated = case.rigs[0], case.healthy[0], case.stated
    named = [fault for fault in case.faults if fault.name in EFFECTS]
    hidden = [fault for fault in named if fault.share is None or fault.share >= VISIBLE[0]]
    small = {"valve-lag": 2.0 * h.zeta / h.omega, "line-delay": float(np.max(h.L)) / SOUND,
             "valve-hysteresis": h.play * stated["full"], "valve-leak": h.C_leak / AREA,
             "presliding": h.Fs / h.presl, "pressure-friction": h.pgain, "pressure-lag": h.tau_p,
             "pressure-offset": h.off[0], "pressure-offset:2": h.off[1],
             "dead-volume": -stated["volume_error"][0], "dead-volume:2": -stated["volume_error"][1]}  # fmt: skip
    if not stated["supply_logged"]:
        small["supply-droop"] = h.Greg
    names = {fault.name for fault in hidden}
    small |= {fault.name: fault.share for fault in named}  # where it does not show
    return {
        "hidden": [fault.name for fault in hidden],
        "unknown": [fault.name for fault in case.faults if fault.name not in EFFECTS],
        "baseline": modelled_effects(case),
        "parameters": {f.name: parameters_of(f, case.rigs, case.healthy, stated["full"]) for f in hidden},
        "present_small": {name: float(value) for name, value in small.items() if name not in names},
        "share": {fault.name: fault.share for fault in case.faults},
        "stated": {name: np.asarray(value).tolist() for name, value in stated.items()},
        "true": {name: np.asarray(r[name]).tolist() for name in RIG.names or ()},
    }


def make(folder: Path, family: str, seed: int, number: int, seconds: tuple[float, float] | None = None) -> Built:
    """Write one case and return it."""
    place = [seed, FAMILIES.index(family), number]
    case = built(family, KINDS[(seed + number + 2 * place[1]) % len(KINDS)], place, seconds)
    if UNLOGGED_SUPPLY & {fault.name for fault in case.faults}:
        case.stated["supply_logged"] = False
    (folder / "raw").mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([*place, 0, 0])
    for k, run in enumerate(case.runs):
        write_recording(folder / "raw" / f"{k + 1}_{run.kind}.csv", run, case.stated, rng)
    (folder / "pipeline.toml").write_text(pipeline_of(folder.name, case), encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps(truth(case), indent=1), encoding="utf-8")
    return case


def asked(folder: Path) -> tuple[str, Counts]:
    """Diagnose a case; return a row for people, and the counts of the answer."""
    written = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as out:
        words = [*own_program(sys.executable), "diagnose", str(folder / "pipeline.toml"), "--out", out]
        code, text, seconds, _ = measured([*words, "--json", "--quiet"])
    row = {"exit": code, **essence("diagnose", text)}
    counts = judged(truth_of(written), row)
    named = ", ".join(f"{name} {row['confidence'][name]}" for name in row.get("missing", [])) or "-"
    path = [step[-1] if step[-1] is not None else step[0] for step in row.get("path", [])] or ["?"]
    cells = [", ".join([*written["hidden"], *written["unknown"]]) or "healthy", row.get("verdict") or f"exit {code}",
             named, f"{counts.found}/{counts.effects}", counts.exact, counts.false, counts.mild,
             f"{path[0]} -> {path[-1]}", f"{seconds:.0f}"]  # fmt: skip
    return " | ".join(map(str, cells)), counts


def main(arguments: Sequence[str]) -> None:
    """Make the cases, and ask for them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.world", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--families", default=",".join(FAMILIES))
    parser.add_argument("--cases", type=int, default=5, help="of each family")
    parser.add_argument("--ask", action="store_true", help="diagnose them; what is there already is not made again")
    parser.add_argument("--small", action="store_true", help="one short case, not asked")
    options = parser.parse_args(arguments)
    if options.small:
        with tempfile.TemporaryDirectory() as name:
            case = make(Path(name) / "fast-01", "fast", options.seed, 0, (1.1, 1.2))
        print(f"{[fault.name for fault in case.faults]}: {sum(len(run.out) for run in case.runs)} samples")
        return
    if options.folder is None:
        parser.error("a folder is needed")
    totals = {family: Counts() for family in options.families.split(",")}
    for family, number in itertools.product(totals, range(options.cases)):
        folder = options.folder / f"{family}-{number + 1:02d}"
        if not (options.ask and (folder / "truth.json").is_file()):
            case = make(folder, family, options.seed, number)
            shares = [f"{f.name} ({f.share:.0%})" if f.share is not None else f.name for f in case.faults]
            print(f"{folder.name}: {', '.join(shares) or 'healthy'}", flush=True)
        if options.ask:
            row, counts = asked(folder)
            totals[family] += counts
            print(f"{folder.name} | {row}", flush=True)
    for family, counts in totals.items() if options.ask else ():
        print(f"{family}: {counts}")


if __name__ == "__main__":
    main(sys.argv[1:])
