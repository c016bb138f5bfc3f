"""Whether the rows of a steady bench are those of a valve: a command that sets an area, and a flow by the pressures."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from pneucli.arrays import Array
from pneucli.distributions import f_tail
from pneucli.identify.valve.flow_bench import FlowBench
from pneucli.identify.valve.steady_rows import FlowPath
from pneucli.messages.findings import Finding

MIN_LOOP_COMMANDS = 5  # commands that were reached from below and from above
MIN_SAME_SENSE = 0.75  # of these, at which the flow differs the same way: by chance 1 of 10 with five, 1 of 600 with 20
MIN_LOOP_SHARE = 0.02  # of the flow, by which it differs: what a meter repeats
MIN_PATH_FLOW = 0.01  # of the largest flow at any command: less is within the zero of a flow meter of 1 %
MAX_SCATTER = 0.1  # rms of the residual over that of the flow: a bench of a valve has 0.02 and less
MIN_LACK_OF_FIT = 3.0  # times the scatter between neighbouring rows: a curve of another shape
MIN_CURVE_ERROR = 0.02  # of the flow: what the equation of ISO 6358 is worth with most valves
MAX_EQUAL_SPREAD = 0.03  # of the conductances, between commands of a valve that its command does not move
MIN_OFFSET_SHARE = 0.02  # of the largest flow, at no pressure difference
MIN_OFFSET_RATIO = 0.9  # pressure ratio that a path must reach to tell what flows at no difference
MIN_RATIO_SPAN = 0.1  # of pressure ratios of a path, without which nothing tells how its flow goes with them
MAX_SET_PRESSURE_SPREAD = 0.15  # of the spread of p1 over all rows, that p1 has at one command of a pressure loop
MIN_SET_PRESSURE_CORRELATION = 0.95  # of p1 and the command of a pressure loop
MIN_VARIED_FLOW = 0.3  # of the largest flow at a command of a pressure loop
MAX_CHANCE = 1e-3  # of a finding where there is nothing
MIN_UPHILL_FLOW = 0.05  # of the largest flow, toward the higher pressure
AREA_FINDINGS = frozenset({"pressure-loop", "flow-scatters", "flow-uphill", "flow-against-pressure", "command-idle"})


def bench_findings(bench: FlowBench) -> Iterator[Finding]:
    """Yield a code and its numbers for each observation that a valve, whose command sets an area, does not explain.

    Args:
        bench: The fitted flow paths.

    """
    uphill = _uphill(bench)
    if uphill:
        yield Finding("flow-uphill", {"rows": uphill, "of": sum(path.rows.flow.size for path in bench.paths)})
    loop = _pressure_loop(bench)
    if loop is not None:
        yield Finding("pressure-loop", loop)
    flowing = _flowing(bench)
    hysteresis = _hysteresis(flowing)
    if hysteresis is not None:
        yield Finding("flow-hysteresis", hysteresis)
    worst = max(flowing, key=_scatter)
    if hysteresis is None and _scatter(worst) > MAX_SCATTER:
        yield Finding("flow-scatters", {"u": worst.rows.u, "share": _scatter(worst)} | _pair(worst))
    misfit = max(flowing, key=_lack_of_fit)
    if _lack_of_fit(misfit) > MIN_LACK_OF_FIT and MIN_CURVE_ERROR < _scatter(misfit) <= MAX_SCATTER:
        yield Finding(
            "curve-not-followed", {"u": misfit.rows.u, "share": _scatter(misfit), "ratio": _lack_of_fit(misfit)}
        )
    yield from _equal_conductances(bench)
    for path in bench.paths:
        if _grows_against_pressure(path):
            yield Finding("flow-against-pressure", {"u": path.rows.u})
            break
    remains = _offset(bench)
    if remains is not None:
        yield Finding("flow-at-no-difference", {"u": remains[1].rows.u, "share": abs(remains[0])})
    described = not uphill and loop is None  # else a cracking pressure is that of no component
    opening = [path for path in bench.paths if path.cracking is not None and described]
    if opening:
        path = max(opening, key=lambda one: one.characteristics.cracking_pressure)
        pressure = path.cracking
        assert pressure is not None
        numbers = {"pressure": (pressure.value, pressure.low, pressure.high), "count": len(opening)}
        yield Finding("cracking-pressure", {"u": path.rows.u, "paths": len(bench.paths), **numbers})


def sets_area(bench: FlowBench) -> bool | None:
    """Return whether the command sets an area; None where one command, or an unknown one, cannot tell.

    Args:
        bench: The fitted flow paths.

    """
    if any(code in AREA_FINDINGS for code, _ in bench_findings(bench)):
        return False
    return True if np.isfinite(bench.commands).sum() > 1 else None


def _hysteresis(paths: list[FlowPath]) -> dict[str, Any] | None:
    """Return by how much the flow differs between rising and falling commands; None where that is within the scatter.

    Rows of a bench that goes up and down: each command is compared with itself, and the command's half width is what
    shifts the flow by half of the difference.
    """
    forward = [path.rows for path in paths if path.rows.direction == "forward" and path.rows.u is not None]
    if len(forward) < MIN_LOOP_COMMANDS:
        return None
    order = sorted(
        (str(recording), int(row), float(rows.u or 0.0))
        for rows in forward
        for recording, row in zip(rows.recording, rows.row, strict=True)
    )
    goes = {b[:2]: np.sign(b[2] - a[2]) for a, b in pairwise(order) if a[0] == b[0]}
    found = []
    for rows in forward:
        sense = np.array([goes.get((str(r), int(n)), 0.0) for r, n in zip(rows.recording, rows.row, strict=True)])
        relative, rising, falling = rows.flow / rows.upstream, np.flatnonzero(sense > 0), np.flatnonzero(sense < 0)
        if rising.size and falling.size:  # each rising row beside the falling one at the pressure ratio next to its own
            apart = np.abs(rows.ratio[rising][:, None] - rows.ratio[falling])
            near, beside = apart.min(axis=1) < MIN_RATIO_SPAN, falling[apart.argmin(axis=1)]
            if near.any():
                up, down = (float(relative[own[near]].mean()) for own in (rising, beside))
                found.append((float(rows.u or 0.0), up, down))
    if len(found) < MIN_LOOP_COMMANDS:
        return None
    u, ups, downs = np.array(found).T
    difference, size = downs - ups, 0.5 * (ups + downs)
    same = float(np.mean(np.sign(difference) == np.sign(np.median(difference))))
    share = float(np.median(np.abs(difference) / size))
    slope = np.gradient(size, u)
    steep = np.abs(slope) > 0.1 * np.abs(slope).max()
    if same < MIN_SAME_SENSE or share < MIN_LOOP_SHARE:
        return None
    return {"share": share, "half_width": 0.5 * float(np.median(np.abs(difference[steep] / slope[steep])))}


def _flowing(bench: FlowBench) -> list[FlowPath]:
    """Return the paths through which gas flows: what a meter shows below its zero scatters by any share of itself."""
    sizes = [float(np.sqrt(np.mean(path.rows.flow**2))) for path in bench.paths]
    return [path for path, size in zip(bench.paths, sizes, strict=True) if size >= MIN_PATH_FLOW * max(sizes)]


def _scatter(path: FlowPath) -> float:
    """Return the rms residual over the rms flow."""
    size = float(np.sqrt(np.mean(path.rows.flow**2)))
    return float(np.sqrt(np.mean(path.residual**2))) / max(size, 1e-300)


def _lack_of_fit(path: FlowPath) -> float:
    """Return the rms residual over the scatter between neighbouring rows."""
    freedom = path.rows.flow.size - 3
    return float(np.sqrt(np.sum((path.residual / path.deviation) ** 2) / freedom)) if freedom > 0 else 0.0


def _pair(path: FlowPath) -> dict[str, float]:
    """Return the two rows with the closest pressures whose flows differ most: their flows in kg/s."""
    order = np.argsort(path.rows.ratio)
    difference = np.abs(np.diff(path.rows.flow[order])) / np.maximum(np.diff(path.rows.ratio[order]), 0.01)
    i = int(np.argmax(difference)) if difference.size else 0
    low, high = sorted(path.rows.flow[order][[i, min(i + 1, order.size - 1)]].tolist())
    return {"low": low, "high": high, "ratio": float(path.rows.ratio[order][i])}


def _uphill(bench: FlowBench) -> int:
    """Return the number of rows that flow toward the higher pressure; 0 where they are too few to matter."""
    count = 0
    for path in bench.paths:
        flows = path.rows.flow > MIN_UPHILL_FLOW * path.rows.flow.max()
        count += int(np.count_nonzero(flows & (path.rows.ratio > 1.0 + 1e-3)))
    return count if count >= 2 else 0


def _pressure_loop(bench: FlowBench) -> dict[str, Any] | None:
    """Return how closely p1 follows the command, whatever flows; None where it does not."""
    forward = [path.rows for path in bench.paths if path.rows.direction == "forward" and path.rows.u is not None]
    if len(forward) < 2:
        return None
    u = np.concatenate([np.full(rows.flow.size, rows.u, dtype=np.float64) for rows in forward])
    p1 = np.concatenate([rows.downstream for rows in forward])
    if not np.ptp(p1) > 0.0 or not np.ptp(u) > 0.0 or min(rows.flow.size for rows in forward) < 3:
        return None
    inside = float(
        np.sqrt(np.mean(np.concatenate([rows.downstream - rows.downstream.mean() for rows in forward]) ** 2))
    )
    varied = float(np.median([np.ptp(rows.flow) / max(rows.flow.max(), 1e-300) for rows in forward]))
    correlation = abs(float(np.corrcoef(u, p1)[0, 1]))
    follows = correlation > MIN_SET_PRESSURE_CORRELATION and inside < MAX_SET_PRESSURE_SPREAD * float(np.std(p1))
    if not follows or not varied > MIN_VARIED_FLOW:
        return None
    flow = np.concatenate([rows.flow for rows in forward])
    (offset, gain, droop), *_ = np.linalg.lstsq(np.column_stack([np.ones(u.size), u, flow]), p1, rcond=None)
    law = {"offset": float(offset), "gain": float(gain), "droop": -float(droop)}
    return {"correlation": correlation, "spread": inside, "varied": varied, **law}


def _equal_conductances(bench: FlowBench) -> Iterator[Finding]:
    for direction in ("forward", "reverse", "to ambient"):
        alike = [path for path in _flowing(bench) if path.rows.direction == direction and path.rows.u is not None]
        sizes = np.array([path.C.value for path in alike])
        if len(alike) >= 2 and float(np.ptp(sizes)) < MAX_EQUAL_SPREAD * float(sizes.mean()):
            yield Finding("command-idle", {"count": len(alike), "spread": float(np.ptp(sizes) / sizes.mean())})


def _grows_against_pressure(path: FlowPath) -> bool:
    """Whether the flow stays as large, or grows, while the pressure difference goes to nothing, as a pump's does."""
    r, flow = path.rows.ratio, path.rows.flow / path.rows.upstream
    if r.size < 4 or float(np.ptp(r)) < MIN_RATIO_SPAN or float(r.max()) < MIN_OFFSET_RATIO:
        return False
    near = flow[r > MIN_OFFSET_RATIO]
    return bool(np.median(near) > 0.9 * float(np.max(flow)))


def _offset(bench: FlowBench) -> tuple[float, FlowPath] | None:
    """Return the flow at no pressure difference over the largest flow of a path, where it matters most, and that path.

    A zero of a flow meter is the same at all commands: one flow is added to all paths, whose C, b and m may move. None
    where the rows show none for certain.
    """
    paths = [p for p in bench.paths if p.rows.flow.size >= 6 and p.rows.ratio.max() > MIN_OFFSET_RATIO]
    paths = [path for path in paths if path.cracking is None]
    if not paths:
        return None
    residual = np.concatenate([path.residual / path.deviation for path in paths])
    offset = np.concatenate([path.rows.sign / path.deviation for path in paths])
    own = block_diag(*(np.column_stack(_tangents(path)) for path in paths))
    columns = np.column_stack([offset, own])
    found, *_ = np.linalg.lstsq(columns, residual, rcond=None)
    without, *_ = np.linalg.lstsq(own, residual, rcond=None)
    freedom = residual.size - columns.shape[1]
    if freedom < 1:
        return None
    before, after = float(np.sum((residual - own @ without) ** 2)), float(np.sum((residual - columns @ found) ** 2))
    chance = f_tail((before - after) / max(after / freedom, 1e-300), 1, freedom)
    least = min(paths, key=lambda path: float(path.rows.flow.max()))
    share = float(found[0]) / float(least.rows.flow.max())
    return (share, least) if chance < MAX_CHANCE and abs(share) > MIN_OFFSET_SHARE else None


def _tangents(path: FlowPath) -> list[Array]:
    """Return the derivatives of the weighted flow by log C, b and m, each (n,)."""
    c = path.characteristics
    rows = path.rows
    moved = (
        replace(c, sonic_conductance=c.sonic_conductance * 1.001),
        replace(c, critical_ratio=c.critical_ratio + 1e-3),
        replace(c, subsonic_index=c.subsonic_index + 1e-3),
    )
    base = path.flow(rows.upstream, rows.downstream, rows.temperature)
    found = []
    for one in moved:
        other = replace(path, characteristics=one).flow(rows.upstream, rows.downstream, rows.temperature)
        found.append((other - base) / 1e-3 / path.deviation)
    return found
