"""Cut valve recordings into stretches of a settled command, laid side by side for one simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from pneucli.errors import InputError
from pneucli.recording import Recording

Array = NDArray[np.float64]

SETTLING = 0.03  # s after a jump of the command that are left out: spool, hose and clock act there, not the map
SHORTEST = 0.03  # s that a stretch must last beyond that
JUMP = 0.005  # of the command's range in one sample
UNEVEN = 0.1  # median departure from the sampling period, over the period: jitter and a few gaps stay below it
SUPPLY_AVERAGE = 0.1  # s over which the supply's reading is averaged: a buffer vessel is slower, noise is not


@dataclass(frozen=True)
class Stretches:
    """``L`` stretches of up to ``N`` samples: arrays of shape ``(N, L)``, padded where ``valid`` is False.

    ``u`` in V, ``supply`` and ``p`` in Pa; ``time`` in s; ``period`` (s) and ``recording`` (index) have shape ``(L,)``.
    """

    time: Array
    u: Array
    supply: Array
    p: Array
    valid: NDArray[np.bool_]
    period: Array
    recording: NDArray[np.int64]


def cut(recordings: Sequence[Recording], supply_pressure: float | None) -> Stretches:
    """Return all stretches between jumps of the command; raise InputError where a signal is missing or none lasts."""
    pieces = [piece for k, r in enumerate(recordings) for piece in _pieces(k, r, supply_pressure)]
    if not pieces:
        raise InputError(
            "valve recordings",
            f"no command is held longer than {1e3 * (SETTLING + SHORTEST):.0f} ms",
            "charge and discharge curves at constant commands",
            "record steps or staircases of u",
        )
    longest = max(piece[1].shape[1] for piece in pieces)
    padded = np.stack([np.pad(s, ((0, 0), (0, longest - s.shape[1])), mode="edge") for _, s, _ in pieces], axis=-1)
    lengths = np.array([s.shape[1] for _, s, _ in pieces])
    time, u, supply, p = padded
    valid = (np.arange(longest)[:, None] < lengths) & np.isfinite(p)
    index = np.array([k for k, _, _ in pieces], dtype=np.int64)
    return Stretches(time, u, supply, p, valid, np.array([dt for _, _, dt in pieces]), index)


def _pieces(index: int, recording: Recording, supply_pressure: float | None) -> list[tuple[int, Array, float]]:
    """Return (recording, rows time, u, supply, p, sampling period) per stretch of one recording."""
    for signal in ("u", "p1"):
        if signal not in recording:
            raise InputError(f"recording {recording.name}", f"no signal {signal}", "u and p1", "see [signals]")
    steps, dt = np.diff(recording.time), recording.period
    if np.median(np.abs(steps - dt)) > UNEVEN * dt:
        found, mend = "sampled unevenly", "resample it, or leave it to the fit of the model"
        raise InputError(f"recording {recording.name}", found, "even sampling", mend)
    supply, u = _supply(recording, supply_pressure), recording["u"]
    rows = np.stack([recording.time, u, supply, recording["p1"]])
    jumps = np.flatnonzero(np.abs(np.diff(u)) > JUMP * max(np.ptp(u), 1e-9)) + 1
    starts, stops = np.append(0, jumps), np.append(jumps, u.size)
    settling, shortest = round(SETTLING / dt), max(4, round(SHORTEST / dt))
    begins = starts + settling * (starts > 0)
    return [(index, rows[:, a:b], dt) for a, b in zip(begins, stops, strict=True) if b - a >= shortest]


def _supply(recording: Recording, supply_pressure: float | None) -> Array:
    if "p_supply" in recording:
        window = max(1, round(SUPPLY_AVERAGE / recording.period))
        return np.asarray(uniform_filter1d(recording["p_supply"], window, mode="nearest"), dtype=np.float64)
    if supply_pressure is None:
        raise InputError(
            f"recording {recording.name}", "no signal p_supply", "a supply pressure", "set rig.supply_pressure"
        )
    return np.full(recording.time.size, supply_pressure)
