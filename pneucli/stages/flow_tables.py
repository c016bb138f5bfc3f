"""The characteristics of a steady bench as artifacts and as answer."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.figure import Figure
from pneucli.identify.valve.flow_bench import FlowBench
from pneucli.identify.valve.flow_findings import bench_findings, sets_area
from pneucli.identify.valve.flow_path import FlowPath
from pneucli.io.artifacts import Tables
from pneucli.physics.iso_flow import FlowCharacteristics, iso_mass_flow
from pneucli.recording import Rig

Array = NDArray[np.float64]
Row = tuple[str, float, str, float, float]
GRID_POINTS = 41  # of the map, over command and over pressure
MAX_SUPPLY_LEVELS = 3  # of the map: the least, the middle and the largest recorded one
MIN_SUPPLY_STEP = 0.05  # of the supply pressure: closer levels are one


def flow_parameters(bench: FlowBench) -> list[Row]:
    """Return C, b, m and the cracking pressure of each path: name, value, unit, 95 % interval."""
    rows: list[Row] = []
    for path in bench.paths:
        label = path_label(bench, path, bench.rig.valve_null)
        named = (
            ("sonic_conductance", "m^3/(s Pa)", path.C),
            ("critical_ratio", "1", path.b),
            ("subsonic_index", "1", path.m),
            ("cracking_pressure", "Pa", path.cracking),
        )
        rows += [_row(f"valve.{name}{label}", unit, figure) for name, unit, figure in named if figure is not None]
    return rows


def _row(name: str, unit: str, figure: Figure) -> Row:
    return name, float(figure.value), unit, float(figure.low), float(figure.high)


def path_label(bench: FlowBench, path: FlowPath, null: float = 0.0) -> str:
    """Return the end of a name: the command, less the ``null``, and the direction where the command has two.

    Parameters of a valve are named by the command less the null, as those of a charge and discharge test are.
    """
    u = path.rows.u
    both = any(one is not path and one.rows.u == u and one.rows.direction == "forward" for one in bench.paths)
    parts = [*([] if u is None else [f"{u - null:+.4g} V"]), *([path.rows.direction] if both else [])]
    return f"({', '.join(parts)})" if parts else ""


def flow_answer(bench: FlowBench) -> dict[str, Any]:
    """Return what ``identify --json`` says of a steady bench."""
    return {
        "paths": [_path_answer(bench, path) for path in bench.paths],
        "parameters": {
            n: {"value": v, "unit": u, "ci95": [low, high]} for n, v, u, low, high in flow_parameters(bench)
        },
        "command_sets_area": sets_area(bench),
        "findings": [{"code": one.code, "text": one.text} for one in bench_findings(bench)],
        "noise": {"constant": bench.law.constant, "relative": bench.law.relative, "unit": "kg/s"},
    }


def _path_answer(bench: FlowBench, path: FlowPath) -> dict[str, Any]:
    rows = path.rows
    ratio = float(np.sqrt(np.mean((path.residual / path.deviation) ** 2)))
    return {
        "name": path_label(bench, path).strip("()"),
        "u": rows.u,
        "direction": rows.direction,
        "rows": int(rows.flow.size),
        "C": _figure(path.C, "m^3/(s Pa)"),
        "b": _figure(path.b, "1"),
        "m": _figure(path.m, "1"),
        "cracking_pressure": None if path.cracking is None else _figure(path.cracking, "Pa"),
        "opens_abruptly": path.characteristics.opens_abruptly,
        "pressure_ratio": [float(rows.ratio.min()), float(rows.ratio.max())],
        "residual": {"rms": float(np.sqrt(np.mean(path.residual**2))), "unit": "kg/s", "ratio_to_noise": ratio},
    }


def _figure(one: Figure, unit: str) -> dict[str, Any]:
    ends = [float(one.low), float(one.high)]
    return {"value": float(one.value), "unit": unit, "ci95": ends, "determined": one.determined}


def write_flow(bench: FlowBench, tables: Tables, *, valve_map: bool) -> None:
    """Write the flow map and its inverse; with ``valve_map`` the map of a vessel too, where its volume is stated.

    Args:
        bench: The fitted paths.
        tables: What writes them.
        valve_map: Whether no other recording gives the valve's map.

    """
    _write_rows(bench, tables)
    u, levels = _command_grid(bench), _supply_levels(bench)
    tables.write(
        "flow_map",
        _stack([_map_columns(bench, u, level) for level in levels]),
        {"u": "V", "p": "Pa"} | dict.fromkeys(("flow", "flow_ci_low", "flow_ci_high"), "kg/s"),
    )
    if np.isfinite(u).sum() < 2:
        return
    tables.write(
        "flow_inverse", _inverse_columns(bench, bench.supply), {"flow": "kg/s", "p": "Pa", "u": "V", "reachable": "1"}
    )
    if valve_map and bench.rig.vessel_volume is not None:
        _write_valve_map(bench, u, tables)


def _write_rows(bench: FlowBench, tables: Tables) -> None:
    """Write the fitted rows with pressure ratio, conductance and residual."""
    paths = bench.paths
    sizes = [path.rows.flow.size for path in paths]
    parts = [_row_columns(path) for path in paths]
    table: dict[str, Any] = {
        "path": [path_label(bench, path).strip("()") for path, n in zip(paths, sizes, strict=True) for _ in range(n)],
        "recording": [str(name) for path in paths for name in path.rows.recording],
        "row": np.concatenate([path.rows.row for path in paths]),
    }
    tables.write(
        "flow_rows",
        table | {name: np.concatenate([part[name] for part in parts]) for name in parts[0]},
        {"row": "1", "ratio": "1", "upstream": "Pa", "downstream": "Pa", "u": "V"}
        | dict.fromkeys(("flow", "fitted", "residual", "deviation"), "kg/s")
        | dict.fromkeys(("conductance", "conductance_fitted"), "m^3/(s Pa)"),
    )


def _row_columns(path: FlowPath) -> dict[str, Array]:
    rows = path.rows
    unit = iso_mass_flow(FlowCharacteristics(1.0), rows.upstream, 0.0 * rows.upstream, rows.temperature)
    fitted = path.flow(rows.upstream, rows.downstream, rows.temperature)
    return {
        "u": np.full(rows.flow.size, np.nan if rows.u is None else rows.u),
        "upstream": rows.upstream,
        "downstream": rows.downstream,
        "ratio": rows.ratio,
        "flow": rows.sign * rows.flow,
        "fitted": rows.sign * fitted,
        "residual": rows.sign * path.residual,
        "deviation": path.deviation,
        "conductance": rows.flow / unit,
        "conductance_fitted": fitted / unit,
    }


def _command_grid(bench: FlowBench) -> Array:
    tested = bench.commands
    known = tested[np.isfinite(tested)]
    if known.size < 2:
        return tested
    return np.unique(np.concatenate([np.linspace(known.min(), known.max(), GRID_POINTS), known]))


def _supply_levels(bench: FlowBench) -> list[float]:
    forward = [path.rows.upstream for path in bench.paths if path.rows.direction == "forward"]
    if not forward:
        return [bench.supply]
    values = np.concatenate(forward)
    levels: list[float] = []
    for level in np.quantile(values, np.linspace(1.0, 0.0, MAX_SUPPLY_LEVELS)).tolist():
        if not levels or level < levels[-1] * (1.0 - MIN_SUPPLY_STEP):
            levels.append(level)
    return sorted(levels)


def _pressures(bench: FlowBench, supply: float) -> Array:
    tops = [float(path.rows.upstream.max()) for path in bench.paths if path.rows.direction == "reverse"]
    least = min(
        bench.rig.ambient_pressure,
        *(float(path.rows.downstream.min()) for path in bench.paths if path.rows.direction == "forward"),
        supply,
    )
    return np.linspace(least, max([supply, *tops]), GRID_POINTS)


def _map_columns(bench: FlowBench, u: Array, supply: float) -> dict[str, Array]:
    at = bench.surface(u, supply, _pressures(bench, supply))
    commands, p = np.meshgrid(at.u, at.p, indexing="ij")
    return {
        "u": commands.ravel(),
        "p_supply": np.full(p.size, supply),
        "p": p.ravel(),
        "flow": at.flow.ravel(),
        "flow_ci_low": (at.flow - at.half).ravel(),
        "flow_ci_high": (at.flow + at.half).ravel(),
    }


def _stack(parts: list[dict[str, Array]]) -> dict[str, Array]:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _inverse_columns(bench: FlowBench, supply: float) -> dict[str, Any]:
    p = _pressures(bench, supply)
    tested = bench.commands[np.isfinite(bench.commands)]
    at = bench.surface(tested, supply, p).flow
    flow = np.linspace(at.min(), at.max(), GRID_POINTS)
    commands, reachable = zip(*(bench.command(flow, supply, float(one)) for one in p), strict=True)
    flows, pressures = np.meshgrid(flow, p, indexing="ij")
    return {
        "flow": flows.ravel(),
        "p": pressures.ravel(),
        "u": np.array(commands).T.ravel(),
        "reachable": np.array(reachable).T.ravel(),
    }


def gradient_per_flow(rig: Rig) -> float:
    """Return dp/dt (Pa/s) in the stated vessel for each kg/s: n R T / V, thesis (2.22).

    >>> print(round(gradient_per_flow(Rig(vessel_volume=1e-3, polytropic_exponent=1.0)) / 1e6, 2))
    84.13
    """
    assert rig.vessel_volume is not None
    exponent = rig.heat_capacity_ratio if rig.polytropic_exponent is None else rig.polytropic_exponent
    return exponent * rig.gas_constant * rig.gas_temperature / rig.vessel_volume


def _write_valve_map(bench: FlowBench, u: Array, tables: Tables) -> None:
    """Write the map and the inverse for the rig's vessel, in the columns of a charge and discharge test."""
    factor, supply = gradient_per_flow(bench.rig), bench.supply
    columns = _map_columns(bench, u, supply)
    ends = {"p_gradient": "flow", "p_gradient_ci_low": "flow_ci_low", "p_gradient_ci_high": "flow_ci_high"}
    table: dict[str, Any] = {"u": columns["u"], "p": columns["p"]}
    table |= {name: factor * columns[flow] for name, flow in ends.items()}
    tables.write(
        "valve_map",
        table | {"covered": np.ones(columns["u"].size, dtype=bool)},
        {"u": "V", "p": "Pa", "covered": "1"} | dict.fromkeys(ends, "Pa/s"),
    )
    inverse = _inverse_columns(bench, supply)
    tables.write(
        "valve_inverse",
        {"p_gradient": factor * inverse.pop("flow"), **inverse},
        {"p_gradient": "Pa/s", "p": "Pa", "u": "V", "reachable": "1"},
    )
