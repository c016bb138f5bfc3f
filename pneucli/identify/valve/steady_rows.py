"""Rows of steady flow, sorted into flow paths by command and direction, each with C, b, m and their intervals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.figure import Figure
from pneucli.physics.iso_flow import FlowCharacteristics, iso_mass_flow
from pneucli.recording import Recording, Rig

SLOPE_STEP = 0.005  # of the upstream pressure, over which the slope of the curve is taken: it is infinite at r = 1
MIN_TRIPLES_BY_TERMS = {3: 20, 2: 8}  # neighbouring rows from which so many terms of the noise may be told
MIN_NOISE = 1e-4  # of the largest flow: finer than any flow meter
# of the largest upstream pressure: usual gauges repeat no better and no worse than this, which few rows can tell
MIN_PRESSURE_NOISE, MAX_PRESSURE_NOISE = 3e-4, 1e-3


@dataclass(frozen=True)
class NoiseLaw:
    """Standard deviation of the flow: sqrt(constant^2 + (relative q)^2 + (pressure dq/dp)^2).

    Attributes:
        constant: In kg/s.
        relative: Share of the flow.
        pressure: In Pa, of the pressures.
    """

    constant: float
    relative: float = 0.0
    pressure: float = 0.0


def flow_deviation(rows: FlowRows, path: FlowCharacteristics, law: NoiseLaw) -> Array:
    """Return the standard deviation of the flow of each row in kg/s: as stated in the pipeline, else by the law.

    Args:
        rows: The rows of a path.
        path: Its characteristics, which give the flow and its slope.
        law: The noise where the pipeline states none.

    Returns:
        Shape (n,), above 0.

    """
    flow, slope = _flow_and_slope(rows, path)
    stated, pressure = rows.stated_noise
    finest = MIN_PRESSURE_NOISE * float(rows.upstream.max())
    own = np.sqrt(stated**2 + (np.where(pressure > 0.0, pressure, finest) * slope) ** 2)
    read = np.clip(law.pressure, finest, MAX_PRESSURE_NOISE / MIN_PRESSURE_NOISE * finest)
    variance = law.constant**2 + (law.relative * flow) ** 2 + (read * slope) ** 2
    least = MIN_NOISE * float(np.max(np.abs(rows.flow)))
    return np.asarray(np.maximum(np.where(stated > 0.0, own, np.sqrt(variance)), least))


def _flow_and_slope(rows: FlowRows, path: FlowCharacteristics) -> tuple[Array, Array]:
    """Return the flow in kg/s of each row, and its slope over the downstream pressure in kg/(s Pa), each (n,)."""
    step = SLOPE_STEP * rows.upstream
    flow, below, above = (
        iso_mass_flow(path, rows.upstream, rows.downstream + side * step, rows.temperature) for side in (0, -1, 1)
    )
    return flow, np.abs(above - below) / (2 * step)


def fit_noise_law(groups: Sequence[FlowRows], paths: Sequence[FlowCharacteristics]) -> NoiseLaw:
    """Estimate the noise law of rows from their residuals.

    Each residual is compared with the straight line between its two neighbours over the pressure ratio (Gasser, Sroka
    and Jennen-Steinmetz, Biometrika 73 (1986) 625), so that a smooth lack of fit does not count as noise.

    Args:
        groups: The rows of each path.
        paths: The fitted characteristics of each.

    Returns:
        The law: constant alone where fewer than 8 triples of rows are known, without the pressure below 20.

    """
    squares, terms, plain = [], [], []
    for rows, path in zip(groups, paths, strict=True):
        order = np.argsort(rows.ratio, kind="stable")
        flow, slope = _flow_and_slope(rows, path)
        residual = (rows.flow - flow)[order]
        plain.append(residual)
        if residual.size < 3:
            continue
        r = rows.ratio[order]
        width = r[2:] - r[:-2]
        share = np.where(width > 0.0, (r[1:-1] - r[:-2]) / np.where(width > 0.0, width, 1.0), 0.5)
        pseudo = residual[1:-1] - (1 - share) * residual[:-2] - share * residual[2:]
        squares.append(pseudo**2 / (1.0 + share**2 + (1 - share) ** 2))
        terms.append(np.column_stack([np.ones(pseudo.size), flow[order][1:-1] ** 2, slope[order][1:-1] ** 2]))
    largest = max(float(np.max(np.abs(rows.flow), initial=0.0)) for rows in groups)
    if not squares:
        freedom = max(sum(one.size for one in plain) - 3, 1)
        return NoiseLaw(max(float(np.sqrt(sum(one @ one for one in plain) / freedom)), MIN_NOISE * largest))
    y, x = np.concatenate(squares), np.concatenate(terms)
    terms_told = next((n for n, least in MIN_TRIPLES_BY_TERMS.items() if y.size >= least), 1)
    return _weighted_law(y, x[:, :terms_told], largest)


def _weighted_law(y: Array, x: Array, largest: float) -> NoiseLaw:
    """Return the law whose variance follows squared residuals (n,); a square scatters as its own expectation."""
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import, and few pipelines have a flow bench

    size = np.maximum(np.sqrt(np.mean(x**2, axis=0)), 1e-300)
    expected = np.full(y.size, max(float(np.mean(y)), (MIN_NOISE * largest) ** 2))
    least, parts = (MIN_NOISE * largest) ** 2, np.zeros(x.shape[1])
    for _ in range(4):
        parts = nnls(x / size / expected[:, None], y / expected)[0] / size
        expected = np.maximum(x @ parts, 0.05 * float(np.mean(y)) + least)
    constant, relative, pressure = [*np.sqrt(parts).tolist(), 0.0, 0.0][:3]
    return NoiseLaw(max(constant, MIN_NOISE * largest), relative, pressure)


Direction = Literal["forward", "reverse", "to ambient"]

MAX_ZERO_FLOW = 0.01  # of the largest flow at a command: a smaller flow has no certain direction
COMMAND_DIGITS = 3  # decimals in V by which commands are grouped: 1 mV is below what a 12-bit output sets


@dataclass(frozen=True)
class FlowRows:
    """Rows of one command and one direction; ``flow`` is positive from ``upstream`` to ``downstream``.

    Attributes:
        u: Command in V; None where the command was neither recorded nor stated.
        direction: ``forward`` from the supply to p1, ``reverse`` from p1 to the supply, ``to ambient`` from p1 out.
        recording: Name of the recording of each row, shape (n,).
        row: Number of each row in its recording, from 0, shape (n,).
        upstream: Absolute pressure in Pa, shape (n,).
        downstream: Absolute pressure in Pa, shape (n,).
        temperature: Temperature upstream in K, shape (n,).
        flow: Mass flow in kg/s, shape (n,).
        stated_noise: Standard deviations of the flow (kg/s) and of the pressures (Pa) that the pipeline states, 0 where
            it states none, shape (n,) each.
    """

    u: float | None
    direction: Direction
    recording: NDArray[np.object_]
    row: NDArray[np.int64]
    upstream: Array
    downstream: Array
    temperature: Array
    flow: Array
    stated_noise: tuple[Array, Array]

    @property
    def sign(self) -> float:
        """1 where the flow counts positive in the recordings, else -1."""
        return 1.0 if self.direction == "forward" else -1.0

    @property
    def ratio(self) -> Array:
        """Ratio of downstream to upstream pressure, shape (n,)."""
        return self.downstream / self.upstream


def flow_rows(recordings: Sequence[Recording], rig: Rig) -> list[FlowRows]:
    """Return the rows of steady benches by command and direction, in rising order of commands.

    Rows in which the flow or a pressure is missing, or a pressure is not positive, are left out.

    Args:
        recordings: Recordings of steady benches.
        rig: The rig, whose supply pressure holds where none was recorded.

    Returns:
        The rows of each path.

    """
    whole = [_columns(one, rig) for one in recordings]
    columns = {key: np.concatenate([part[key] for part in whole]) for key in whole[0]} if whole else {}
    if not columns:
        return []
    commands = columns["u"]
    levels = [*np.unique(commands[np.isfinite(commands)]), *([np.nan] if np.isnan(commands).any() else [])]
    found = []
    for u in levels:
        chosen = np.isnan(commands) if np.isnan(u) else commands == u
        found += [*_directions({key: values[chosen] for key, values in columns.items()}, rig)]
    return found


def _columns(recording: Recording, rig: Rig) -> dict[str, NDArray[np.generic]]:
    """Return the usable rows of a recording."""
    n = recording.time.size
    supply = recording.signals.get("p_supply", np.full(n, rig.supply_pressure or np.nan))
    temperature = recording.signals.get("temperature", np.full(n, rig.gas_temperature))
    temperature = np.where(np.isfinite(temperature), temperature, rig.gas_temperature)
    u = np.round(recording.signals.get("u", np.full(n, np.nan)), COMMAND_DIGITS) + 0.0
    noise = {name: recording.noise_rms(name) for name in ("flow", "p1", "p_supply")}
    columns: dict[str, NDArray[np.generic]] = {
        "recording": np.full(n, recording.name, dtype=object),
        "row": np.arange(n),
        "u": u,
        "supply": supply,
        "p1": recording["p1"],
        "temperature": temperature,
        "flow": recording["flow"],
        "flow_noise": np.full(n, noise["flow"]),
        "pressure_noise": np.full(n, np.hypot(noise["p1"], noise["p_supply"])),
    }
    usable = (supply > 0.0) & (recording["p1"] > 0.0) & np.isfinite(recording["flow"]) & (temperature > 0.0)
    return {key: values[usable] for key, values in columns.items()}


def _directions(columns: dict[str, NDArray[np.generic]], rig: Rig) -> Iterator[FlowRows]:
    """Yield the rows of one command by direction; a row without flow goes with the direction that its command has."""
    flow, p1, supply = (columns[name].astype(np.float64) for name in ("flow", "p1", "supply"))
    flows = np.abs(flow) > MAX_ZERO_FLOW * float(np.max(np.abs(flow), initial=0.0))
    back = np.where(p1 > supply, "reverse", "to ambient")
    direction = np.where(flow > 0.0, "forward", back)
    certain = [name for name in ("forward", "reverse", "to ambient") if (flows & (direction == name)).any()]
    by_pressure = np.where(supply >= p1, "forward", "reverse")
    rest = certain[0] if len(certain) == 1 else None
    direction = np.where(flows, direction, by_pressure if rest is None else rest)
    u = float(columns["u"].astype(np.float64)[0]) if flow.size else np.nan
    for name in ("forward", "reverse", "to ambient"):
        chosen = direction == name
        if not chosen.any():
            continue
        ambient = np.full(flow.size, rig.ambient_pressure)
        upstream = supply if name == "forward" else p1
        downstream = {"forward": p1, "reverse": supply, "to ambient": ambient}[name]
        yield FlowRows(
            u=None if np.isnan(u) else u,
            direction=name,
            recording=columns["recording"].astype(object)[chosen],
            row=columns["row"].astype(np.int64)[chosen],
            upstream=upstream[chosen],
            downstream=downstream[chosen],
            temperature=columns["temperature"].astype(np.float64)[chosen],
            flow=(flow if name == "forward" else -flow)[chosen],
            stated_noise=(
                columns["flow_noise"].astype(np.float64)[chosen],
                columns["pressure_noise"].astype(np.float64)[chosen],
            ),
        )


@dataclass(frozen=True)
class FlowPath:
    """The characteristics of one flow path, and how far its rows lie from them.

    Attributes:
        rows: The rows that were fitted.
        characteristics: C, b, m and cracking pressure.
        C: Sonic conductance in m^3/(s Pa) at the reference atmosphere.
        b: Critical ratio.
        m: Subsonic index.
        cracking: Cracking pressure in Pa; None where the rows show none.
        covariance: Covariance of (log C, b, m, cracking pressure in Pa), shape (4, 4).
        quantile: Student quantile of the intervals.
        deviation: Standard deviation of the noise of each row in kg/s, shape (n,).
    """

    rows: FlowRows
    characteristics: FlowCharacteristics
    C: Figure
    b: Figure
    m: Figure
    cracking: Figure | None
    covariance: Array
    quantile: float
    deviation: Array

    @property
    def residual(self) -> Array:
        """Measured less fitted flow in kg/s, shape (n,)."""
        return self.rows.flow - self.flow(self.rows.upstream, self.rows.downstream, self.rows.temperature)

    def flow(self, upstream: Array, downstream: Array, temperature: Array | float) -> Array:
        """Return the flow in kg/s at pressures (Pa) and temperatures (K), each (n,)."""
        return iso_mass_flow(self.characteristics, upstream, downstream, temperature)

    def flow_error(self, upstream: Array, downstream: Array, temperature: float) -> Array:
        """Return the half width of the 95 % interval of the flow in kg/s, shape (n,)."""
        z = coordinates_of(self.characteristics)
        steps = np.array([1e-4, 1e-4, 1e-4, max(1e-3 * self.characteristics.cracking_pressure, 1.0)])
        rows = []
        for i, step in enumerate(steps):
            ends = []
            for side in (step, -step):
                moved = z.copy()
                moved[i] += side
                at = characteristics_at(moved, abrupt=self.characteristics.opens_abruptly)
                ends.append(iso_mass_flow(at, upstream, downstream, temperature))
            rows.append((ends[0] - ends[1]) / (2 * step))
        slope = np.array(rows)
        variance = np.einsum("in,ij,jn->n", slope, self.covariance, slope)
        return np.asarray(self.quantile * np.sqrt(np.maximum(variance, 0.0)))


def characteristics_at(z: Array, *, abrupt: bool) -> FlowCharacteristics:
    """Return the characteristics at z, shape (4,): log C (m^3/(s Pa)), b, m, cracking pressure in Pa."""
    return FlowCharacteristics(float(np.exp(z[0])), float(z[1]), float(z[2]), max(float(z[3]), 0.0), abrupt)


def coordinates_of(of: FlowCharacteristics) -> Array:
    """Return the coordinates, shape (4,), of characteristics: log C (m^3/(s Pa)), b, m, cracking pressure in Pa."""
    return np.array([np.log(of.sonic_conductance), of.critical_ratio, of.subsonic_index, of.cracking_pressure])
