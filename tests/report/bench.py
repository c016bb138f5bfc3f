"""What a report is made of, by hand: small tables in the layout of the artifacts, all numbers invented."""

from dataclasses import replace
from typing import Any

import numpy as np

from pneucli.figure import read
from pneucli.messages import compare, diagnose
from pneucli.messages.history import Model
from pneucli.report.report_data import Check, EarlierAnswer, ReportData, Table
from tests.report import controlled

SAMPLES = 4000
TIME = np.arange(SAMPLES) * 1e-3
NOISE = {"p1": 400.0, "x": 3e-5, "v": 1e-3}
UNIT = {"p1": "Pa", "x": "m", "v": "m/s"}
LEAK = {"value": 5.2e-8, "unit": "m^2", "ci95": [5.1e-8, 5.3e-8]}
RECORDINGS = {"axis_1": "train", "axis_<b>&_$2$": "test"}  # a name may hold anything but a slash


def _signals() -> dict[str, np.ndarray]:
    x = 0.1 + 0.04 * np.sin(2 * np.pi * TIME)
    return {
        "u": 5 * np.sin(2 * np.pi * TIME + 1),
        "p1": 4e5 + 1e5 * np.sin(2 * np.pi * TIME - 1),
        "x": x,
        "v": np.gradient(x, TIME),
    }


def _ingest() -> dict[str, Any]:
    rows = [
        {
            "name": name,
            "experiment": "axis",
            "use": use,
            "chamber_2": "closed",
            "imposed": "",
            "file": f"raw/{use}.csv",
            "sha256": "ab" * 32,
            "samples": SAMPLES,
            "period": 1e-3,
            "signals": ["time", "u", "p1", "x"],
            "from": 0.0,
            "to": TIME[-1],
            "noise": {c: {"rms": n, "unit": UNIT[c]} for c, n in NOISE.items()},
        }
        for name, use in RECORDINGS.items()
    ]
    return {"recordings": rows, "repairs": [], "warnings": ["axis_1, p1: 3 samples were lost"]}


def _compare(ratios: dict[str, float]) -> dict[str, Any]:
    channels = [
        {
            "recording": name,
            "use": use,
            "channel": channel,
            "unit": UNIT[channel],
            "rmsd": ratio * NOISE[channel],
            "percent": 0.2,
            "relative_error_percent": 0.1,
            "fit_percent": 99.0,
            "noise": NOISE[channel],
            "ratio_to_noise": ratio,
        }
        for name, use in RECORDINGS.items()
        for channel, ratio in ratios.items()
    ]
    region = {
        "recording": "axis_1",
        "event": 0,
        "channel": "x",
        "signal": "x",
        "from": 0.12,
        "to": 0.14,
        "unit": "m",
        "share_of_error": 0.61,
        "share_of_samples": 0.1,
    }
    error = float(np.sqrt(np.mean(np.square(list(ratios.values())))))
    model = {"effects": ["stribeck", "piston-leak"], "parameters": {"piston-leak.area": LEAK}}
    more = {"model": model, "when": "2026-11-22T10:00:00Z", "data": "bench"}
    errors = {"train": error, "test": error}
    return {"horizon_s": 0.5, "channels": channels, "error": errors, "where": [region], **more}


def _residuals(fault: float = 5.0) -> Table:
    """Noise, and in the last second, at one place of the stroke, a fault of so many times the noise."""
    columns: dict[str, list[Any]] = {n: [] for n in ("recording", "use", "channel", "unit")}
    numbers: dict[str, list[Any]] = {n: [] for n in ("time", "measured", "model", "residual", "segment")}
    signals = _signals()
    segment, rng = np.arange(SAMPLES) // 500, np.random.default_rng(1)
    for name, use in RECORDINGS.items():
        for channel, noise in NOISE.items():
            residual = noise * rng.standard_normal(SAMPLES)
            residual += fault * noise * ((signals["x"] > 0.12) & (TIME > 3.0) & (channel == "x"))
            for column, text in zip(columns, (name, use, channel, UNIT[channel]), strict=True):
                columns[column] += [text] * SAMPLES
            rare = (channel == "v") & (np.arange(SAMPLES) % 10 > 0)  # recorded ten times more rarely
            measured, residual = (np.where(rare, np.nan, y) for y in (signals[channel], residual))
            values = (TIME, measured, signals[channel] if fault == 5.0 else measured - residual, residual, segment)
            for column, part in zip(numbers, values, strict=True):
                numbers[column].append(part)
    return Table({**columns, **{n: np.concatenate(parts) for n, parts in numbers.items()}})


def _valve() -> dict[str, Table]:
    u, p = (grid.ravel() for grid in np.meshgrid(np.linspace(-10, 10, 9), np.linspace(1e5, 7e5, 7), indexing="ij"))
    gradient = 2e5 * u * np.where(u > 0, 8e5 - p, p) / 7e5
    band = {"p_gradient_ci_low": gradient - 1e3, "p_gradient_ci_high": gradient + 1e3}
    time = np.linspace(0, 1, 50)
    steps = [(c, 4e5 + 2e4 * c * time) for c in (-10.0, -5.0, 5.0, 10.0)]
    curve = {"measured": np.concatenate([y + 400 for _, y in steps]), "fitted": np.concatenate([y for _, y in steps])}
    slope = np.repeat([2e4 * c for c, _ in steps], 50)
    return {
        "identify/valve_map": Table({"u": u, "p": p, "p_gradient": gradient, **band, "covered": p > 2e5}),
        "identify/valve_lack_of_fit": Table(
            {"u": u, "p": p, "model": 0.97 * gradient,
             "model_ci_low": 0.96 * gradient, "model_ci_high": 0.98 * gradient,
             "measured": gradient, "measured_ci_low": gradient - 1e3, "measured_ci_high": gradient + 1e3,
             "difference": 0.03 * gradient, "outside": abs(gradient) > 2e5}
        ),
        "identify/valve_inverse": Table(
            {"p_gradient": gradient.mean() + 1e5 * u, "p": p, "u": np.clip(u, -8, 8), "reachable": abs(u) < 8}
        ),
        "identify/valve_areas": Table(
            {"u": [-10.0, -5.0, 5.0, 10.0], "area": [2e-6, 1e-6, 1e-6, 2e-6], "ci_low": [1.9e-6, 9e-7, 9e-7, 1.9e-6],
             "ci_high": [2.1e-6, 1.1e-6, 1.1e-6, 2.1e-6]},
            {"area": "m^2"},
        ),
        "identify/valve_curves": Table(
            {"recording": ["stairs"] * 200, "u": np.repeat([c for c, _ in steps], 50),
             "time": np.tile(time, 4), **curve, "gradient": slope, "ci_low": slope - 1e3, "ci_high": slope + 1e3}
        ),
    }  # fmt: skip


def _friction() -> dict[str, Table]:
    v = np.linspace(-0.5, 0.5, 101)
    force = 10 * np.tanh(v / 0.01) + 20 * v
    branched = [(m, b) for m in "ABC" for b in ("both",)] + [(m, b) for m in "DEF" for b in ("accelerating", "slowing")]
    one = {"v": v, "force": force, "ci_low": force - 1, "ci_high": force + 1, "count": np.full(v.size, 9.0)}
    return {
        "identify/friction_models": Table(
            {"model": [m for m, _ in branched for _ in v], "branch": [b for _, b in branched for _ in v],
             "v": np.tile(v, 9), "force": np.tile(force, 9)}
        ),
        "identify/friction_curves": Table({"branch": ["both"] * v.size, **one}),
        "identify/friction_deviations": Table(
            {"model": ["A", "A", "D", "D"], "recording": ["all"] * 4, "use": ["test"] * 4, "channel": ["a", "v"] * 2,
             "rmsd": [0.2, 2e-3, 0.1, 1e-3], "unit": ["m/s^2", "m/s"] * 2, "percent": [2.0, 1.0, 0.9, 0.4],
             "noise": [0.1, 1e-3] * 2, "lacks": ["friction-hysteresis"] * 2 + [""] * 2}
        ),
        "identify/friction_parameters": Table(
            {"model": ["A"], "branch": ["both"], "name": ["coulomb"], "value": [10.0], "unit": ["N"], "ci_low": [9.9],
             "ci_high": [10.1]}
        ),
        "identify/friction_cuts": Table(
            {"recording": ["axis_1"] * 60, "cut": np.repeat([0.0, 1.0], 30), "direction": np.repeat([1.0, -1.0], 30),
             "speed": np.tile(np.linspace(0, 0.2, 30), 2), "force": np.tile(np.linspace(12, 14, 30), 2)}
        ),
        "identify/tp_weights": Table(
            {"model": ["B"] * 202, "branch": ["both"] * 202, "vertex": np.repeat([0.0, 1.0], 101), "v": np.tile(v, 2),
             "weight": np.concatenate([1 / (1 + abs(v) / 0.01), 1 - 1 / (1 + abs(v) / 0.01)])}
        ),
        "identify/tp_vertices": Table(
            {"model": ["B", "B"], "branch": ["both"] * 2, "vertex": [0.0, 1.0], "a22": [7000.0, 30.0]}
        ),
    }  # fmt: skip


def _relations() -> dict[str, Table]:
    names, lag = ["friction.coulomb", "friction.viscous"], np.linspace(-0.5, 0.5, 101)
    texts = {"recording": "axis_1", "use": "train", "channel": "x", "against": "u"}
    return {
        "identify/correlation": Table(
            {"name": np.repeat(names, 2), "other": names * 2, "correlation": np.array([1.0, -0.95, -0.95, 1.0])}
        ),
        "identify/sensitivity": Table({"name": names, "channel": ["x", "v"], "times_noise": np.array([0.4, 0.02])}),
        "identify/iterations": Table(
            {"effects": ["", "", "stribeck"], "search": [1, 1, 2], "round": [0, 1, 0], "residual": [9.0, 3.0, 2.0]}
        ),
        "compare/correlation": Table(
            {**{n: [t] * 101 for n, t in texts.items()}, "lag": lag, "bound": np.full(101, 0.1),
             "correlation": 0.5 * np.exp(-((lag - 0.1) ** 2) / 0.01)}
        ),
    }  # fmt: skip


def _diagnosis() -> dict[str, Any]:
    area = {"area": LEAK}
    return {
        "model": {"effects": ["stribeck"]},
        "verdict": "missing-effect",
        "missing": ["piston-leak"],
        "sentence": "The model lacks piston-leak (leak across the piston): with it the error falls.",
        "ladder": [
            {"add": None, "error_train": 9.1, "error_test": 9.4},
            {"add": "piston-leak", "error_train": 1.02, "error_test": None},
        ],
        "candidates": [
            {
                "effect": "piston-leak",
                "title": "Leak across the piston",
                "error_before": 9.4,
                "error_after": 1.05,
                "parameters": area,
                "indistinguishable_from": ["chamber-leak"],
                "supported": True,
                "why": "It explains the creep.",
            }
        ],
        "unexplained_share": 0.04,
        "unexplained": None,
        "next_experiment": "Hold the piston for 30 s.",
        "detectable": [
            {"effect": "valve-leak", "parameter": "area", "size": 2e-8, "unit": "m^2", "would_show": "above 0.02 mm2"}
        ],
        "moved": [{"parameter": "friction.coulomb", "from": 20.0, "to": 14.0, "unit": "N", "plausible": False}],
    }


def _shape() -> Table:
    value = np.linspace(1e5, 5e5, 20)
    texts = {"effect": "piston-leak", "recording": "axis_1", "channel": "p1", "variable": "p1", "unit": "Pa"}
    return Table(
        {
            **{name: [text] * 20 for name, text in texts.items()},
            "value": value,
            "residual_before": 0.01 * value,
            "residual_after": np.zeros(20),
            "expected": 0.0099 * value,
        }
    )


def _open_loop() -> Table:
    value = np.sin(TIME)
    texts = {"scenario": "steps", "channel": "x", "unit": "m"}
    columns = {name: [text] * SAMPLES for name, text in texts.items()}
    return Table({**columns, "time": TIME, "value": value, "measured": np.full(SAMPLES, np.nan)})


def whole() -> ReportData:
    """A report with every section that there is."""
    parameters = {"friction.coulomb": {"value": 14.0078, "unit": "N", "ci95": [13.98, 14.03]}}
    signals = {name: np.tile(values, 2) for name, values in _signals().items() if name != "v"}
    named = [name for name in RECORDINGS for _ in TIME]
    metrics = {"channel": "x", "unit": "m", "from": 0.0, "to": 0.1, "end": 0.1, "rmsd": None, "fit_percent": None}
    return ReportData(
        name="bench & co",
        answers={
            "ingest": _ingest(),
            "identify": {
                "model": {"effects": ["stribeck"], "parameters": parameters},
                "warnings": [],
                "valve": {
                    "overlap": {"charge": {"value": 0.2, "unit": "V", "ci95": [0.19, 0.21]}},
                    "iso": {},
                    "lack_of_fit": {"median": 0.03, "p95": 0.031, "share_outside": 0.8},
                    "residual": {"train": 1.02, "test": None, "recordings": []},
                },
            },
            "compare": _compare({"p1": 1.0, "x": 3.0, "v": 1.1}),
            "diagnose": _diagnosis(),
            "design": controlled.design(),
            "simulate": {"open_loop": [{"scenario": "steps", "channels": [metrics]}], **controlled.simulated()},
        },
        tables={
            "ingest/signals": Table({"recording": named, "time": np.tile(TIME, 2), **signals}),
            "compare/residuals": _residuals(),
            "diagnose/shape": _shape(),
            "simulate/open_loop": _open_loop(),
            **controlled.tables(),
            **_valve(),
            **_friction(),
            **_relations(),
        },
        checks=[
            Check("compare.error.test", "max 1.5", 1.94, "compare.error.test = 1.94 (max 1.5): FAILED"),
            Check("identify.model.effects", "equals ['stribeck']", ["stribeck"]),
        ],
        footer={"made by": "a test"},
        history=[before(("stribeck", "piston-leak"), {"p1": 1.0, "x": 3.0, "v": 1.1}, 0, current=True)],
    )


def before(effects: tuple[str, ...], ratios: dict[str, float], number: int, *, current: bool) -> Model:
    """One entry of the history."""
    compared = _compare(ratios)
    parameters = {"piston-leak.area": LEAK} if "piston-leak" in effects else {}
    model = {"effects": list(effects), "parameters": parameters, "error": compared["error"]}
    when = f"2026-11-2{number}T10:00:00Z"
    return read(Model, {**model, "data": "bench", "when": when, "current": current})


def fallen() -> ReportData:
    """The same report after piston-leak was added: the first model had ten times the fault, and one was tried."""
    first = {"p1": 9.0, "x": 50.0, "v": 1.2}
    former = _compare(first)
    now = whole()
    adequate = {"verdict": "adequate", "missing": [], "ladder": _diagnosis()["ladder"][:1], "candidates": []}
    adequate |= {"sentence": "Nothing is missing that these recordings could show."}
    diagnosed = _diagnosis() | adequate | {"model": {"effects": ["stribeck", "piston-leak"]}, "next_experiment": None}
    ways: list[tuple[tuple[str, ...], dict[str, float]]] = [
        (("stribeck",), first),
        (("stribeck", "valve-lag"), {"p1": 8.0, "x": 48.0, "v": 1.2}),
        (("stribeck", "piston-leak"), {"p1": 1.0, "x": 3.0, "v": 1.1}),
    ]
    return replace(
        now,
        answers={**now.answers, "diagnose": diagnosed},
        history=[before(effects, r, i, current=i == 2) for i, (effects, r) in enumerate(ways)],
        first_comparison=EarlierAnswer(
            read(compare.Answer, former | {"model": {"effects": ["stribeck"], "parameters": {}}}), _residuals(50.0)
        ),
        diagnoses=[EarlierAnswer(read(diagnose.Answer, _diagnosis()), _shape())],
        rig="cylinder",
    )


def without(material: ReportData, *stages: str) -> ReportData:
    """The same report, had these stages never run."""
    answers = {name: answer for name, answer in material.answers.items() if name not in stages}
    tables = {name: table for name, table in material.tables.items() if name.split("/")[0] not in stages}
    return replace(material, answers=answers, tables=tables)
