"""The location of the error: intervals, worst first, and maps of the residual over two state variables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from matplotlib.colors import LogNorm

from pneucli.arrays import Array
from pneucli.messages import compare, ingest
from pneucli.messages.formatting import (
    axis_title,
    format_number,
    format_percent,
    in_display_unit,
    join_names,
    signal_unit,
)
from pneucli.report.figure import ORANGE, Drawing, drawing, figures, heat_map, plain_numbers
from pneucli.report.page_elements import Cell, Columns, Grid, Note, Part, Section, grid
from pneucli.report.report_data import ReportData, Table

PLACE = 10  # on the page
MAP_CELLS = 24  # along each side of a map
MIN_CELL_SAMPLES = 5  # samples that a cell needs to be drawn
MAX_MAPS = 3  # channels, those with the largest error of the first model
COLOUR_FLOOR = 0.3  # times the noise: the end of the colours; no cell of five samples of pure noise lies far below
MAX_LOCATIONS = 3  # locations of one event in the table
STATES = ("u", "p1", "p2", "p1 - p2", "x", "v")


@dataclass(frozen=True)
class StateSamples:
    """Residuals of one channel in units of the noise floor (n,), and the states (n,) at which they arose."""

    experiment: str
    channel: str
    residual: Array
    states: Mapping[str, Array]

    @property
    def rms(self) -> float:
        """Root mean square of the residual: 1 is the noise floor."""
        return float(np.sqrt(np.nanmean(self.residual**2)))


def section(material: ReportData) -> Section | None:
    """Return maps of the first and the present model, and the worst intervals; absent where nothing was compared."""
    if not material.answer("compare"):
        return None
    answer = material.read(compare.Answer)
    now = _clouds(material, answer, material.table("compare/residuals"))
    former = material.first_comparison
    first = _clouds(material, former.answer, former.table) if former else {}
    worst = sorted(now, key=lambda key: -(first.get(key) or now[key]).rms)[:MAX_MAPS]
    parts: list[Part] = []
    for key in worst:
        parts += figures(_maps(first.get(key), now[key]))
    events = answer.events
    even = Note(answer.even_error, "good" if answer.rating == "good" else "")
    parts.append(_events(events) if events else even)
    lead = (
        "Each map pools all recordings of an experiment over the two variables over which the error varies most; the "
        "line in the colour bar is 1, the noise floor."
    )
    return Section("where", "Where the model fails", lead, parts)


def _events(events: Sequence[Sequence[compare.Region]]) -> Grid:
    columns: Columns[Sequence[compare.Region]] = {
        "recording": lambda event: event[0].recording,
        "channels": lambda event: join_names(list(dict.fromkeys(r.channel for r in event))),
        "where": lambda event: "; ".join(dict.fromkeys(r.text for r in event[:MAX_LOCATIONS])),
        "share of error": lambda event: _share(event[0].share_of_error),
        "share of samples": lambda event: _share(event[0].share_of_samples),
    }
    caption = "Intervals whose share of the squared error is at least twice their share of the samples, worst first"
    return grid(caption, events, columns, folded=True)


def _share(size: float) -> Cell:
    return Cell(format_percent(size), bar=size)


def _clouds(material: ReportData, answer: compare.Answer, table: Table) -> dict[tuple[str, str], StateSamples]:
    """Return a model's residuals by experiment and channel, all recordings of it together."""
    noise = {c.key: c.noise for c in answer.channels if c.noise > 0.0}
    kind = {one.name: _kind(one) for one in material.read(ingest.Answer).recordings}
    signals = {name: rows for (name,), rows in material.table("ingest/signals").groups("recording")}
    residuals = dict(table.groups("recording", "channel"))
    pooled: dict[tuple[str, str], list[tuple[Array, dict[str, Array]]]] = {}
    for (recording, channel), rows in residuals.items():
        if recording in material.steady_recordings:  # few rows over pressures, which have a chapter of their own
            continue
        if recording in signals and noise.get((recording, channel)):
            speed = residuals.get((recording, "v"))
            states = _states(signals[recording], None if speed is None else speed["measured"])
            if all(values.size == len(rows) for values in states.values()):
                scaled = rows["residual"] / noise[recording, channel]
                pooled.setdefault((kind.get(recording, ""), channel), []).append((scaled, states))
    return {key: _cloud(*key, parts) for key, parts in pooled.items()}


def _kind(recording: ingest.Recording) -> str:
    return f"{recording.experiment}{' (imposed motion)' if recording.imposed else ''}"


def _cloud(experiment: str, channel: str, parts: list[tuple[Array, dict[str, Array]]]) -> StateSamples:
    shared = [name for name in STATES if all(name in states for _, states in parts)]
    states = {name: np.concatenate([one[name] for _, one in parts]) for name in shared}
    return StateSamples(experiment, channel, np.concatenate([residual for residual, _ in parts]), states)


def _states(signals: Table, speed: Array | None) -> dict[str, Array]:
    states = {n: signals[n] for n in STATES if n in signals and np.isfinite(signals[n]).any()}
    if "p1" in states and "p2" in states:
        states["p1 - p2"] = states["p1"] - states["p2"]  # what friction of seals depends on
    if speed is not None:
        states["v"] = speed
    elif "x" in states and "v" not in states and len(signals) > 50:
        from scipy.signal import savgol_filter  # noqa: PLC0415 - slow to import, and most recordings have a velocity

        period = float(np.median(np.diff(signals["time"])))
        states["v"] = np.asarray(savgol_filter(states["x"], 21, 2, deriv=1, delta=period))
    return states


def _maps(first: StateSamples | None, now: StateSamples) -> list[Drawing]:
    """Draw the rms residual of both models over the pair of states over which the first model's error varies most.

    Both maps have the same scale; there is none where fewer than two states move.
    """
    judge = first or now
    moving = [name for name, values in judge.states.items() if np.nanmax(values) > np.nanmin(values)]
    grids = [(_grid(judge, *pair), pair) for pair in combinations(moving, 2)]
    if not grids:
        return []
    (*_, rms, _), pair = max(grids, key=lambda grid: grid[0][3])
    most = max(2.0, float(np.nanmax(rms, initial=0.0)))
    if first is None:
        return [_map("present model", now, pair, most)]
    return [_map("before", first, pair, most), _map("after", now, pair, most)]


def _map(when: str, cloud: StateSamples, pair: tuple[str, str], most: float) -> Drawing:
    x, y = pair
    edges_x, edges_y, rms, _ = _grid(cloud, x, y)
    worst = format_number(float(np.nanmax(rms, initial=0.0)), 3)
    caption = (
        f"{cloud.channel} in {cloud.experiment} recordings, {when}: {format_number(cloud.rms, 3)} × noise over all "
        f"samples, up to {worst} × in the worst cell."
    )
    with drawing(caption, axis_title(x), axis_title(y)) as one:
        ends = in_display_unit(edges_x, signal_unit(x)), in_display_unit(edges_y, signal_unit(y))
        title = f"rms residual of {cloud.channel}, × noise"
        bar = heat_map(one, *ends, rms.T, title, norm=LogNorm(vmin=COLOUR_FLOOR, vmax=most))
        bar.ax.axhline(1.0, color=ORANGE, linewidth=2)
        plain_numbers(bar.ax)
    return one


def _grid(cloud: StateSamples, x: str, y: str) -> tuple[Array, Array, Array, float]:
    """Return edges, the rms residual (CELLS, CELLS), NaN where few samples fell, and how uneven it is (>= 0).

    Unevenness is the Kullback-Leibler divergence of the squared error's distribution from that of the samples.
    """
    a, b, squared = cloud.states[x], cloud.states[y], cloud.residual**2
    seen = np.isfinite(a) & np.isfinite(b) & np.isfinite(squared)
    a, b, squared = a[seen], b[seen], squared[seen]
    edges = [np.histogram_bin_edges(values, MAP_CELLS) for values in (a, b)]
    count, *_ = np.histogram2d(a, b, edges)
    total, *_ = np.histogram2d(a, b, edges, weights=squared)
    full = count >= MIN_CELL_SAMPLES
    if not full.any() or not total[full].sum() > 0:
        return edges[0], edges[1], np.full(count.shape, np.nan), -1.0
    error, samples = total[full] / total[full].sum(), count[full] / count[full].sum()
    some = error > 0
    uneven = float(np.sum(error[some] * np.log(error[some] / samples[some])))
    rms = np.full(count.shape, np.nan)
    rms[full] = np.sqrt(total[full] / count[full])
    return edges[0], edges[1], rms, uneven
