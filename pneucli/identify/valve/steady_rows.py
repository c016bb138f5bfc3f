"""Rows of steady flow, sorted into flow paths: one path for each command and direction of flow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.recording import Recording, Rig

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
