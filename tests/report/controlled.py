"""Design, closed loop and Monte Carlo study by hand, in the layout of the artifacts; all numbers invented."""

from typing import Any

import numpy as np

from pneucli.closed_loop.metrics import Metrics
from pneucli.report.report_data import Table

PERIOD = 1e-3
TIME = PERIOD * np.arange(3000)
REACH = 5e-6
SCENARIOS = ("steps", "load")
SHOWN = {"steady_um": 4.0, "overshoot_um": 80.0, "rise_s": 0.5, "settling_s": 0.75, "air_kg": 7e-4}
UNDER_LOAD = {"steady_um": 5.0, "recovery_s": 0.25, "peak_um": 5900.0, "load_error": 0.01, "air_kg": 3e-4}
STUDY = {  # effect: errors at rest in um of its runs; the last one's load is never rejected
    "": (3.0, 4.0),
    "piston-leak": (4.0, 5.0),
    "presliding": (8.0, 120.0),
}
LIMITS = {"steady_um": 10.0, "recovery_s": 0.5}


def design() -> dict[str, Any]:
    """The answer of the stage ``design``."""
    sector = {"lambda_1": 7705.0, "lambda_2": 15411.0, "steepness": 15.4}
    return {
        "requirements": {"period": PERIOD, "tolerance": None},
        "corners": {"motion_observer": {"value": 300.0, "unit": "1/s"}},
        "sector": {"vertices": {**sector, "speed_floor": 1.3e-3, "remark": "too steep"}},
        "matching": {
            "whole": {"holds": False, "broken_by": {"friction and load": ["v"]}},
            "mechanical": {"holds": True, "broken_by": {}},
        },
        "lmi": {
            "best": "CNO",
            "types": [
                {"weight_type": "CNO", "rate": 0.84, "unit": "1/s", "status": "optimal", "verified": True},
                {"weight_type": "NO", "rate": None, "unit": "1/s", "status": "infeasible", "verified": False},
            ],
        },
        "controllers": {"best": "cascade", "pdc": "parallel distributed compensation"},
        "not_made": {"sector": "the sliding sector: there is none"},
        "tolerance_um": 2e6 * REACH,
        "compare": {
            name: bench(*of) for name, of in {"best": (4.0, 0.0), "pdc": (7800.0, 0.0), "pid": (90.0, 40.0)}.items()
        },
        "without_map": {"best, no map": bench(9.0, 0.0)},
        "ablation": {"nothing": bench(4.0, 0.0), "switching": bench(400.0, 0.0)},
        "margins": margins(),
        "warnings": ["no PDC: the input bound is too narrow"],
    }


def margins() -> dict[str, Any]:
    """Margins of one loop at two places, the second one growing."""
    of = {"gain_up": None, "gain_down": 0.5, "phase": 0.5, "delay": 2.4e-3, "modulus": 0.4, "crossover": 190.0}
    points = [{"loop": "command", "x": x, "speed": 0.02, "stable": x < 0.1, **of} for x in (0.06, 0.14)]
    return {
        "points": points,
        "worst": {"command": {n: v for n, v in of.items() if n != "crossover"}},
        "stuck": [{"x": 0.1, "direction": 1.0}],
        "left_out": ["Play between command and opening"],
        "overlap": {"value": 0.4, "unit": "V"},
    }


def ensemble() -> dict[str, Any]:
    """What a design on an ensemble of rigs says of it: 38 of 40 rigs hold, one figure never does."""
    limits = ("rest", "motion", "load", "chattering")
    row = {"rigs": 40, "held": 38, "probability": 0.851, "median": dict.fromkeys(limits, 0.2)}
    row |= {"worst": {"rest": 1.2, "motion": 0.3, "load": None, "chattering": 0.5}}
    return {
        "laws": {"best": row, "pid, ensemble": row},
        "limits": {name: {"value": 5e-5, "unit": "m"} for name in limits},
        "confidence": 0.95,
        "effects": ["valve-lag"],
        "limiting": None,
        "rescued": {"valve-lag": 0},
        "separate": None,
    }


def bench(steady: float, cycle: float) -> dict[str, Any]:
    """A controller's figures in two scenarios; those of the load are never back within 50 um."""
    empty = dict.fromkeys(Metrics.__annotations__)
    told = {"steady_um": steady, "cycle_um": cycle, "fast_v": 0.3, "air_kg": 4e-4}
    return {"steps": {**empty, **told}, "load": {**empty, **told, "peak_um": 900.0}}


def simulated() -> dict[str, Any]:
    """The closed loop's part of the answer of the stage ``simulate``."""
    empty = dict.fromkeys(Metrics.__annotations__)
    alone = {"steps": {**SHOWN, "steady_um": 117.0, "settling_s": None}, "load": {**UNDER_LOAD, "recovery_s": None}}
    return {
        "closed_loop": {"steps": {**empty, **SHOWN}, "load": {**empty, **UNDER_LOAD}},
        "pid_alone": {name: {**empty, **figures} for name, figures in alone.items()},
        "tolerance_um": 2e6 * REACH,
        "robust": _robust(),
    }


def _robust() -> dict[str, Any]:
    recovery = {effect: np.inf if effect == "presliding" else 0.3 for effect in STUDY}
    rates = []
    for check, limit in LIMITS.items():
        found = {e: v if check == "steady_um" else (recovery[e],) for e, v in STUDY.items()}
        for effect, values in {"all": sum(found.values(), ()), **found}.items():
            worst = max(values)
            rates.append(
                {"check": check, "limit": limit, "effect": effect, "held": sum(v <= limit for v in values),
                 "runs": len(values), "worst": worst if np.isfinite(worst) else None, "worst_run": 1}
            )  # fmt: skip
    checks = {r["check"]: r for r in rates if r["effect"] == "all"}
    return {"runs": 3, "seed": 7, "checks": checks, "by_effect": rates}


def tables() -> dict[str, Table]:
    """The tables of both stages."""
    effects = [effect for effect, values in STUDY.items() for _ in values]
    recovery = np.array([np.inf if effect == "presliding" else 0.3 for effect in effects])
    return {
        "design/gains": Table({"name": ["C_MASS", "C_HOLDING_BAND"], "value": [2.2, REACH], "unit": ["kg", "m"]}),
        "design/margins": Table(
            {
                "loop": ["command"] * 4,
                "x": [0.06, 0.06, 0.14, 0.14],
                "speed": [0.02] * 4,
                "frequency": [1.0, 2.0, 1.0, 2.0],
                "real": [-2.0, -0.5, -3.0, -0.4],
                "imaginary": [0.1, -0.1, 0.2, -0.3],
            }
        ),
        "simulate/closed_loop": _runs(),
        "simulate/robust": Table(
            {"effect": effects, "steady_um": np.concatenate(list(STUDY.values())), "recovery_s": recovery}
        ),
    }


def _runs() -> Table:
    """Two scenarios, each compensated (4 um off at the end) and with the PIDs only (117 um off)."""
    columns: dict[str, list[Any]] = {"scenario": [], "controller": []}
    numbers: dict[str, list[Any]] = {}
    reference = np.where(TIME < 0.5, 0.1, 0.13)
    for scenario in SCENARIOS:
        load = np.where(TIME > 1.0, -50.0, 0.0) if scenario == "load" else np.zeros(TIME.size)
        for controller, off in (("compensated", 4e-6), ("pid_alone", 117e-6)):
            columns["scenario"] += [scenario] * TIME.size
            columns["controller"] += [controller] * TIME.size
            pressure, command = np.full(TIME.size, 3e5), np.sin(40 * TIME)
            parts = {"time": TIME, "x_ref": reference, "x": reference - off, "p1": pressure, "p1_ref": pressure + 1e3}
            parts |= {"u": command, "u2": np.zeros(TIME.size), "load": load, "load_estimate": 0.99 * load}
            for name, part in parts.items():
                numbers.setdefault(name, []).append(part)
    return Table({**columns, **{name: np.concatenate(parts) for name, parts in numbers.items()}})
