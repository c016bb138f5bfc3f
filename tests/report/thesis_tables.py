"""Tables for the report of the thesis, by hand: friction laws, the sliding sector, controllers, one inflation."""

from typing import Any

import numpy as np

from pneucli.report.report_data import ReportData, Table
from tests.report.bench import answer, whole

TIME = 1e-2 * np.arange(600)
STRIBECK = (("coulomb", 14.0), ("viscous", 45.0), ("static", 22.0), ("velocity", 0.015))
SLOWING = (("coulomb", 12.0), ("viscous", 40.0))
SECTOR = {"lambda_1": 14.0, "lambda_2": 28.0, "eta": 2.8}


def friction_parameters() -> Table:
    """Model A, and model D with other friction while slowing."""
    laws = {("A", "both"): STRIBECK, ("D", "accelerating"): STRIBECK, ("D", "slowing"): SLOWING}
    rows = [(*law, name, value) for law, values in laws.items() for name, value in values]
    return Table(dict(zip(("model", "branch", "name", "value"), map(list, zip(*rows, strict=True)), strict=True)))


def runs(*names: str) -> Table:
    """Steps, a load, and a pressure that is asked for, under each of the controllers."""
    columns: dict[str, list[Any]] = {}
    asked, load = np.where(TIME < 2.0, 3e5, 3.5e5), np.where(TIME > 3.0, -50.0, 0.0)
    x = 0.1 + 1e-3 * np.exp(-2.0 * TIME)
    for name in names:
        for scenario in ("steps", "load", "pressure"):
            reference = np.where(TIME < 2.0, 0.1, 0.13) if scenario != "pressure" else np.full(TIME.size, np.nan)
            parts: dict[str, Any] = {
                "scenario": [scenario] * TIME.size, "controller": [name] * TIME.size,
                "time": TIME, "x_ref": reference, "x": x, "v": -2.0 * (x - 0.1), "x_shaped": np.full(TIME.size, 0.1),
                "p1": asked - 1e3, "p1_ref": asked, "u": np.sin(TIME), "flow_estimate": np.cos(TIME),
                "load_estimate": 0.1 * TIME, "load": load * (scenario == "load"),
            }  # fmt: skip
            for key, part in parts.items():
                columns.setdefault(key, []).append(part)
    return Table({key: np.concatenate(parts) for key, parts in columns.items()})


def replays() -> Table:
    """One slip under every friction model."""
    t = 1e-3 * np.arange(50)
    one = {"time": t, "v": t, "v_model": 0.9 * t, "a": t, "a_model": t}
    return Table({"model": [m for m in "ABCDEF" for _ in t], **{name: np.tile(y, 6) for name, y in one.items()}})


def inflation() -> dict[str, Table]:
    """One charge of a vessel, with its mass flow, from a recorded supply."""
    p, time = np.linspace(1e5, 6e5, 60), 1e-3 * np.arange(60)
    curve = {"recording": ["step"] * 60, "u": np.full(60, 5.0), "time": time, "measured": p, "fitted": p}
    flows = {"gradient": np.linspace(2e6, 1e5, 60), "mass_flow": np.linspace(1e-3, 1e-4, 60)}
    supply = Table({"recording": ["step"] * 60, "p_supply": np.full(60, 7e5)})
    return {"identify/valve_curves": Table(curve | flows), "ingest/signals": supply}


def material() -> ReportData:
    """A report with every figure of the thesis."""
    names = ("best", "pdc", "pid", "compensated", "compensated, no map", "sector")
    tables = {
        **whole().tables,
        **inflation(),
        "identify/friction_parameters": friction_parameters(),
        "identify/friction_replays": replays(),
        "design/comparison_signals": runs(*names),
    }
    design = answer("design")
    design["sector"] = design["sector"] | {"design": SECTOR}
    return ReportData("demo", {"design": design}, tables)


def without_volume() -> ReportData:
    """The inflation of a vessel whose volume is not stated: there is no mass flow."""
    tables = inflation()
    curves = tables["identify/valve_curves"]
    unknown = Table({**curves.columns, "mass_flow": np.full(len(curves), np.nan)})
    return ReportData("demo", {}, {**tables, "identify/valve_curves": unknown})
