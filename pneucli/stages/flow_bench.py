"""Steady benches in ``identify`` and ``compare``: by themselves, whatever else a pipeline records."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.compare.channel_errors import channel_result
from pneucli.errors import InputError
from pneucli.figure import Figure, named, to_answer
from pneucli.identify.valve.charge_budget import with_flow_budgets
from pneucli.identify.valve.flow_bench import FlowBench, FlowComparison, compare_flow, identify_flow_bench
from pneucli.identify.valve.flow_findings import bench_findings, sets_area
from pneucli.identify.valve.steady_rows import FlowPath
from pneucli.identify.valve.uncertainty import COVERAGE_FACTOR
from pneucli.io.artifacts import Tables
from pneucli.messages.compare import ChannelResult, ModelAnswer
from pneucli.messages.findings import tell
from pneucli.messages.flow import Flow, FlowFinding, FlowResidual
from pneucli.messages.flow import FlowPath as FlowPathAnswer
from pneucli.messages.identify import Answer, Uncertainty
from pneucli.physics.iso_flow import FlowCharacteristics, iso_mass_flow
from pneucli.pipeline.graph import NotApplicable
from pneucli.quantities import SIGNALS
from pneucli.recording import Rig
from pneucli.stages.answer_parts import assumed_values, measurement_of
from pneucli.stages.identify_tables import write_budgets, write_parameters
from pneucli.stages.pipeline_data import PipelineData

RATIO_PORT, LEAK_PORT = "critical_ratio", "leak_area"  # where effects act that rows of steady flow can show


def flow_bench(study: PipelineData) -> FlowBench | None:
    """Return the flow paths of the steady benches; None where the pipeline records none.

    Raises InputError where rows are recorded and none can be fitted.
    """
    if not study.flow_recordings:
        return None
    bench = identify_flow_bench(study.flow_recordings, study.rig)
    if bench is None:
        names = ", ".join(one.name for one in study.flow_recordings if one.use == "train") or "none of use train"
        mend = 'check the columns of flow, p_supply and p1, and that one recording has use = "train"'
        raise InputError(
            f"{study.context.path}, key recordings", f"no row with a flow ({names})", "rows of flow", mend, code="E060"
        )
    recorded = set.intersection(*(set(one.signals) for one in study.flow_recordings))
    null = bench.rig.valve_null
    return with_flow_budgets(bench, lambda path: path_label(bench, path, null), measurement_of(study), sorted(recorded))


def identify_flow_only(study: PipelineData) -> dict[str, Any]:
    """Identify a pipeline that records steady benches alone; write its files, return the answer of ``identify``."""
    study.context.progress("fitting the flow of each opening")
    bench = flow_bench(study)
    assert bench is not None
    tables = study.tables("identify", "ingest/signals.parquet")
    write_parameters(flow_parameters(bench), tables)
    write_flow(bench, tables, valve_map=True)
    write_budgets(bench.budgets, tables)
    flow = flow_answer(bench)
    idle = [effect.name for effect in study.effects if not {RATIO_PORT, LEAK_PORT} & effect.ports.keys()]
    unused = [tell("effects-idle", names=", ".join(idle))] if idle else []
    answer = Answer(
        schema="pneucli/identify/1",
        pipeline=study.context.config.name,
        model=ModelAnswer([e.name for e in study.effects], flow.parameters),
        assumed=assumed_values(study, set()),
        warnings=[*(one.text for one in flow.findings), *unused],
        flow=flow,
        uncertainty=Uncertainty(COVERAGE_FACTOR, bench.budgets),
    )
    return to_answer(answer)


def require_recordings_over_time(study: PipelineData) -> None:
    """Raise NotApplicable where the pipeline records steady benches alone."""
    if not study.recordings:
        wanted = "a recording over time: a valve test, a friction test or an axis"
        raise NotApplicable(f"{study.context.path}", "rows of a steady bench alone", wanted, code="E060")


def flow_results(comparisons: Sequence[FlowComparison]) -> list[ChannelResult]:
    """Return the error of the channel ``flow`` in each recording of a steady bench."""
    return [
        channel_result(one.recording, "flow", one.measured, one.predicted, one.noise)
        for one in comparisons
        if np.isfinite(one.predicted).any()
    ]


def compare_flow_recordings(study: PipelineData) -> list[FlowComparison]:
    """Return measured and fitted flow of every recording of a steady bench; the fit is that of ``identify``."""
    bench = flow_bench(study)
    return [] if bench is None else compare_flow(bench, study.flow_recordings)


def flow_residual_blocks(comparisons: Sequence[FlowComparison]) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of ``residuals.parquet``: the number of the row takes the place of time."""
    unit = SIGNALS["flow"].unit
    for one in comparisons:
        curves = one.row.astype(np.float64), one.measured, one.predicted, one.measured - one.predicted
        yield one.recording.name, one.recording.use, "flow", unit, *curves, np.zeros(one.row.size)


GRID_POINTS = 41  # of the map, over command and over pressure
MAX_SUPPLY_LEVELS = 3  # of the map: the least, the middle and the largest recorded one
MIN_SUPPLY_STEP = 0.05  # of the supply pressure: closer levels are one


def flow_parameters(bench: FlowBench) -> dict[str, Figure]:
    """Return C, b, m and the cracking pressure of each path by name."""
    found = {}
    for path in bench.paths:
        label = path_label(bench, path, bench.rig.valve_null)
        for name, unit, figure in (
            ("sonic_conductance", "m^3/(s Pa)", path.C),
            ("critical_ratio", "1", path.b),
            ("subsonic_index", "1", path.m),
            ("cracking_pressure", "Pa", path.cracking),
        ):
            if figure is not None:
                found[f"valve.{name}{label}"] = _figure(figure, unit)
    return found


def path_label(bench: FlowBench, path: FlowPath, null: float = 0.0) -> str:
    """Return the end of a name: the command, less the ``null``, and the direction where the command has two.

    Parameters of a valve are named by the command less the null, as those of a charge and discharge test are.
    """
    u = path.rows.u
    both = any(one is not path and one.rows.u == u and one.rows.direction == "forward" for one in bench.paths)
    parts = [*([] if u is None else [f"{u - null:+.4g} V"]), *([path.rows.direction] if both else [])]
    return f"({', '.join(parts)})" if parts else ""


def flow_answer(bench: FlowBench) -> Flow:
    """Return what ``identify`` says of a steady bench."""
    return Flow(
        paths=[_path_answer(bench, path) for path in bench.paths],
        parameters=flow_parameters(bench),
        command_sets_area=sets_area(bench),
        findings=[FlowFinding(one.code, one.text) for one in bench_findings(bench)],
        noise=named(bench.law, "constant relative") | {"unit": "kg/s"},
    )


def _path_answer(bench: FlowBench, path: FlowPath) -> FlowPathAnswer:
    rows = path.rows
    ratio = float(np.sqrt(np.mean((path.residual / path.deviation) ** 2)))
    return FlowPathAnswer(
        *(path_label(bench, path).strip("()"), rows.u, rows.direction, int(rows.flow.size)),
        *(_figure(path.C, "m^3/(s Pa)"), _figure(path.b, "1"), _figure(path.m, "1")),
        cracking_pressure=None if path.cracking is None else _figure(path.cracking, "Pa"),
        opens_abruptly=path.characteristics.opens_abruptly,
        pressure_ratio=[float(rows.ratio.min()), float(rows.ratio.max())],
        residual=FlowResidual(float(np.sqrt(np.mean(path.residual**2))), "kg/s", ratio),
    )


def _figure(one: Figure, unit: str) -> Figure:
    return replace(one, value=float(one.value), low=float(one.low), high=float(one.high), unit=unit)


def write_flow(bench: FlowBench, tables: Tables, *, valve_map: bool) -> None:
    """Write the flow map and its inverse; with ``valve_map`` the map of a vessel too, where its volume is stated.

    Args:
        bench: The fitted paths.
        tables: What writes them.
        valve_map: Whether no other recording gives the valve's map.

    """
    columns = (
        "path, recording, row [1], u [V], upstream [Pa], downstream [Pa], ratio [1], flow [kg/s], fitted [kg/s], "
        "residual [kg/s], deviation [kg/s], conductance [m^3/(s Pa)], conductance_fitted [m^3/(s Pa)]"
    )
    tables.write("flow_rows", columns, [_rows(bench, path) for path in bench.paths])
    u, levels = _command_grid(bench), _supply_levels(bench)
    columns = "u [V], p_supply, p [Pa], flow [kg/s], flow_ci_low [kg/s], flow_ci_high [kg/s]"
    tables.write("flow_map", columns, [_map(bench, u, level) for level in levels])
    if np.isfinite(u).sum() < 2:
        return
    tables.write("flow_inverse", "flow [kg/s], p [Pa], u [V], reachable [1]", [_inverse(bench, bench.supply)])
    if valve_map and bench.rig.vessel_volume is not None:
        _write_valve_map(bench, u, tables)


def _rows(bench: FlowBench, path: FlowPath) -> tuple[Any, ...]:
    """Return the fitted rows with pressure ratio, conductance and residual."""
    rows = path.rows
    unit = iso_mass_flow(FlowCharacteristics(1.0), rows.upstream, 0.0 * rows.upstream, rows.temperature)
    fitted = path.flow(rows.upstream, rows.downstream, rows.temperature)
    return (
        *(path_label(bench, path).strip("()"), np.array([*map(str, rows.recording)], dtype=object), rows.row),
        *(np.nan if rows.u is None else rows.u, rows.upstream, rows.downstream, rows.ratio),
        *(rows.sign * rows.flow, rows.sign * fitted, rows.sign * path.residual, path.deviation),
        *(rows.flow / unit, fitted / unit),
    )


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


def _map(bench: FlowBench, u: Array, supply: float) -> tuple[Any, ...]:
    at = bench.surface(u, supply, _pressures(bench, supply))
    commands, p = np.meshgrid(at.u, at.p, indexing="ij")
    low, high = at.flow - at.half, at.flow + at.half
    return commands.ravel(), supply, p.ravel(), at.flow.ravel(), low.ravel(), high.ravel()


def _inverse(bench: FlowBench, supply: float) -> tuple[Array, ...]:
    p = _pressures(bench, supply)
    tested = bench.commands[np.isfinite(bench.commands)]
    at = bench.surface(tested, supply, p).flow
    flow = np.linspace(at.min(), at.max(), GRID_POINTS)
    commands, reachable = zip(*(bench.command(flow, supply, float(one)) for one in p), strict=True)
    flows, pressures = np.meshgrid(flow, p, indexing="ij")
    return flows.ravel(), pressures.ravel(), np.array(commands).T.ravel(), np.array(reachable).T.ravel()


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
    factor = gradient_per_flow(bench.rig)
    commands, _, p, *flows = _map(bench, u, bench.supply)
    block = (commands, p, *(factor * flow for flow in flows), np.ones(p.size, dtype=bool))
    columns = "u [V], p [Pa], p_gradient [Pa/s], p_gradient_ci_low [Pa/s], p_gradient_ci_high [Pa/s], covered [1]"
    tables.write("valve_map", columns, [block])
    flow, *rest = _inverse(bench, bench.supply)
    tables.write("valve_inverse", "p_gradient [Pa/s], p [Pa], u [V], reachable [1]", [(factor * flow, *rest)])
