"""What a report is made of: stored answers and tables in the layout of the artifacts, all numbers invented."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.figure import read
from pneucli.messages import compare, diagnose
from pneucli.messages.history import Model
from pneucli.report.report_data import Check, EarlierAnswer, ReportData, Table

STORED = (Path(__file__).parent / "stored" / "report.json").read_text(encoding="utf-8")
SAMPLES = 4000
TIME, LOOP = np.arange(SAMPLES) * 1e-3, np.arange(3000) * 1e-3
NOISE = {"p1": 400.0, "x": 3e-5, "v": 1e-3}
UNIT = {"p1": "Pa", "x": "m", "v": "m/s"}
LEAK = {"value": 5.2e-8, "unit": "m^2", "ci95": [5.1e-8, 5.3e-8]}
RECORDINGS = {"axis_1": "train", "axis_<b>&_$2$": "test"}  # a name may hold anything but a slash


def answer(name: str) -> dict[str, Any]:
    """The stored answer of a stage, or what a design on an ensemble says; each call returns one of its own."""
    found: dict[str, Any] = json.loads(STORED)["answers"][name]
    return found


def tables() -> dict[str, Table]:
    """The stored tables."""
    return {name: Table(one["columns"], one.get("units", {})) for name, one in json.loads(STORED)["tables"].items()}


def _signals() -> dict[str, np.ndarray]:
    x = 0.1 + 0.04 * np.sin(2 * np.pi * TIME)
    return {
        "u": 5 * np.sin(2 * np.pi * TIME + 1),
        "p1": 4e5 + 1e5 * np.sin(2 * np.pi * TIME - 1),
        "x": x,
        "v": np.gradient(x, TIME),
    }


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


def _open_loop() -> Table:
    value = np.sin(TIME)
    texts = {"scenario": "steps", "channel": "x", "unit": "m"}
    columns = {name: [text] * SAMPLES for name, text in texts.items()}
    return Table({**columns, "time": TIME, "value": value, "measured": np.full(SAMPLES, np.nan)})


def _closed_loop() -> Table:
    """Two scenarios, each compensated (4 um off at the end) and with the PIDs only (117 um off)."""
    columns: dict[str, list[Any]] = {"scenario": [], "controller": []}
    numbers: dict[str, list[Any]] = {}
    reference = np.where(LOOP < 0.5, 0.1, 0.13)
    for scenario in ("steps", "load"):
        load = np.where(LOOP > 1.0, -50.0, 0.0) if scenario == "load" else np.zeros(LOOP.size)
        for controller, off in (("compensated", 4e-6), ("pid_alone", 117e-6)):
            columns["scenario"] += [scenario] * LOOP.size
            columns["controller"] += [controller] * LOOP.size
            pressure, command = np.full(LOOP.size, 3e5), np.sin(40 * LOOP)
            parts = {"time": LOOP, "x_ref": reference, "x": reference - off, "p1": pressure, "p1_ref": pressure + 1e3}
            parts |= {"u": command, "u2": np.zeros(LOOP.size), "load": load, "load_estimate": 0.99 * load}
            for name, part in parts.items():
                numbers.setdefault(name, []).append(part)
    return Table({**columns, **{name: np.concatenate(parts) for name, parts in numbers.items()}})


def whole() -> ReportData:
    """A report with every section that there is."""
    signals = {name: np.tile(values, 2) for name, values in _signals().items() if name != "v"}
    named = [name for name in RECORDINGS for _ in TIME]
    return ReportData(
        name="bench & co",
        answers={
            **{name: answer(name) for name in ("ingest", "identify")},
            "compare": _compare({"p1": 1.0, "x": 3.0, "v": 1.1}),
            **{name: answer(name) for name in ("diagnose", "design", "simulate")},
        },
        tables={
            "ingest/signals": Table({"recording": named, "time": np.tile(TIME, 2), **signals}),
            "compare/residuals": _residuals(),
            "simulate/open_loop": _open_loop(),
            "simulate/closed_loop": _closed_loop(),
            **tables(),
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
    adequate = {"verdict": "adequate", "missing": [], "ladder": answer("diagnose")["ladder"][:1], "candidates": []}
    adequate |= {"sentence": "Nothing is missing that these recordings could show."}
    diagnosed = (
        answer("diagnose") | adequate | {"model": {"effects": ["stribeck", "piston-leak"]}, "next_experiment": None}
    )
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
        diagnoses=[EarlierAnswer(read(diagnose.Answer, answer("diagnose")), tables()["diagnose/shape"])],
        rig="cylinder",
    )


def without(material: ReportData, *stages: str) -> ReportData:
    """The same report, had these stages never run."""
    answers = {name: answer for name, answer in material.answers.items() if name not in stages}
    tables = {name: table for name, table in material.tables.items() if name.split("/")[0] not in stages}
    return replace(material, answers=answers, tables=tables)
