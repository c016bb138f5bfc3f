"""Where the model fails: stretches in words, worst first, and maps of the residual over two state variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from pneucli.report.figure import Drawing, drawing, figures, heat
from pneucli.report.material import Material, Table
from pneucli.report.parts import Cell, Grid, Note, Part, Section
from pneucli.report.shown import axis, number, percent, shown, shown_unit, signal_unit

Array = NDArray[np.float64]
CELLS = 24  # along each side of a map
FULL = 5  # samples that a cell needs to be drawn
MAPS = 6
FIRST = 8  # stretches that stand open
_DIRECTIONS = {-1: "toward −x", 0: "at rest", 1: "toward +x"}
STATES = ("u", "p1", "p2", "x", "v")


@dataclass(frozen=True)
class Cloud:
    """Residuals of one channel in units of the noise floor (n,), and the states (n,) at which they arose."""

    experiment: str
    channel: str
    residual: Array
    states: Mapping[str, Array]

    @property
    def rms(self) -> float:
        """Root mean square of the residual: 1 is the noise floor."""
        return float(np.sqrt(np.nanmean(self.residual**2)))


def section(material: Material) -> Section | None:
    """Return stretches and maps; absent where nothing was compared."""
    answer = material.answer("compare")
    if not answer:
        return None
    regions = answer.get("where", [])
    parts: list[Part] = [] if regions else [Note("No channel errs remarkably beyond noise.", "good")]
    parts += [_regions(some, folded) for some, folded in ((regions[:FIRST], False), (regions[FIRST:], True)) if some]
    clouds = sorted(_clouds(material), key=lambda cloud: -cloud.rms)[:MAPS]
    parts += figures([one for cloud in clouds if (one := _map(cloud)) is not None])
    lead = (
        "A stretch is listed where it holds at least twice as much of the squared error as of the samples. The maps "
        "pool all recordings of an experiment, each over those two variables over which the error is least even."
    )
    return Section("where", "Where it fails", lead, parts)


def _regions(regions: Sequence[Mapping[str, Any]], folded: bool) -> Grid:
    rows = [
        [
            Cell(r["recording"], numeric=False),
            Cell(r["channel"], numeric=False),
            Cell(axis(r["signal"]).split(" in ")[0], numeric=False),
            Cell(_span(r)),
            Cell(percent(r["share_of_error"]), bar=r["share_of_error"]),
            Cell(percent(r["share_of_samples"]), bar=r["share_of_samples"]),
        ]
        for r in regions
    ]
    head = ("recording", "channel", "over", "from – to", "share of error", "share of samples")
    caption = "The stretches after these" if folded else "Where the error concentrates, worst first."
    return Grid(caption, head, rows, folded)


def _span(region: Mapping[str, Any]) -> str:
    if region["signal"] == "direction":
        within = [name for sign, name in _DIRECTIONS.items() if region["from"] <= sign <= region["to"]]
        return " or ".join(within)
    low, high = (number(float(shown(float(region[end]), region["unit"])), 3) for end in ("from", "to"))
    return f"{low} – {high} {shown_unit(region['unit'])}".rstrip()


def _clouds(material: Material) -> list[Cloud]:
    """Return the residuals by experiment and channel, all recordings of it together."""
    noise = {(c["recording"], c["channel"]): c["noise"] for c in material.answer("compare")["channels"]}
    kind = {r["name"]: _kind(r) for r in material.answer("ingest").get("recordings", [])}
    signals = {name: rows for (name,), rows in material.table("ingest/signals").groups("recording")}
    residuals = dict(material.table("compare/residuals").groups("recording", "channel"))
    pooled: dict[tuple[str, str], list[tuple[Array, dict[str, Array]]]] = {}
    for (recording, channel), rows in residuals.items():
        if recording in signals and noise.get((recording, channel)):
            speed = residuals.get((recording, "v"))
            states = _states(signals[recording], None if speed is None else speed["measured"])
            if all(values.size == len(rows) for values in states.values()):
                scaled = rows["residual"] / noise[recording, channel]
                pooled.setdefault((kind.get(recording, ""), channel), []).append((scaled, states))
    return [_cloud(experiment, channel, parts) for (experiment, channel), parts in pooled.items()]


def _kind(recording: Mapping[str, Any]) -> str:
    return f"{recording['experiment']}{' (imposed motion)' if recording.get('imposed') else ''}"


def _cloud(experiment: str, channel: str, parts: list[tuple[Array, dict[str, Array]]]) -> Cloud:
    shared = [name for name in STATES if all(name in states for _, states in parts)]
    states = {name: np.concatenate([one[name] for _, one in parts]) for name in shared}
    return Cloud(experiment, channel, np.concatenate([residual for residual, _ in parts]), states)


def _states(signals: Table, speed: Array | None) -> dict[str, Array]:
    states = {n: signals[n] for n in STATES if n in signals and np.isfinite(signals[n]).any()}
    if speed is not None:
        states["v"] = speed
    elif "x" in states and "v" not in states and len(signals) > 50:
        period = float(np.median(np.diff(signals["time"])))
        states["v"] = np.asarray(savgol_filter(states["x"], 21, 2, deriv=1, delta=period))
    return states


def _map(cloud: Cloud) -> Drawing | None:
    """Draw the rms residual over the pair of states over which it is least even; None where there is no pair."""
    moving = [name for name, values in cloud.states.items() if np.nanmax(values) > np.nanmin(values)]
    grids = [(_grid(cloud, *pair), pair) for pair in combinations(moving, 2)]
    if not grids:
        return None
    (edges_x, edges_y, rms, _), (x, y) = max(grids, key=lambda grid: grid[0][3])
    caption = (
        f"{cloud.channel} in {cloud.experiment} recordings: {number(cloud.rms, 3)} × noise over all samples, up to "
        f"{number(float(np.nanmax(rms)), 3)} × in the worst cell."
    )
    with drawing(caption, axis(x), axis(y)) as one:
        ends = shown(edges_x, signal_unit(x)), shown(edges_y, signal_unit(y))
        heat(one, *ends, rms.T, f"rms residual of {cloud.channel}, × noise", vmin=0.0, vmax=max(2.0, np.nanmax(rms)))
    return one


def _grid(cloud: Cloud, x: str, y: str) -> tuple[Array, Array, Array, float]:
    """Return edges, the rms residual (CELLS, CELLS), NaN where few samples fell, and how uneven it is (>= 0).

    Unevenness is the Kullback-Leibler divergence of the squared error's distribution from that of the samples.
    """
    a, b, squared = cloud.states[x], cloud.states[y], cloud.residual**2
    seen = np.isfinite(a) & np.isfinite(b) & np.isfinite(squared)
    a, b, squared = a[seen], b[seen], squared[seen]
    edges = [np.histogram_bin_edges(values, CELLS) for values in (a, b)]
    count, *_ = np.histogram2d(a, b, edges)
    total, *_ = np.histogram2d(a, b, edges, weights=squared)
    full = count >= FULL
    if not full.any() or not total[full].sum() > 0:
        return edges[0], edges[1], np.full(count.shape, np.nan), -1.0
    error, samples = total[full] / total[full].sum(), count[full] / count[full].sum()
    some = error > 0
    uneven = float(np.sum(error[some] * np.log(error[some] / samples[some])))
    rms = np.full(count.shape, np.nan)
    rms[full] = np.sqrt(total[full] / count[full])
    return edges[0], edges[1], rms, uneven
