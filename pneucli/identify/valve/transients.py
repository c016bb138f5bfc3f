"""Cut valve recordings into stretches of a settled command, laid side by side for one simulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from pneucli.errors import InputError
from pneucli.identify.valve.resampling import MAX_RESAMPLING_ERROR, interpolation_error, is_unevenly_sampled, resample
from pneucli.recording import Recording

Array = NDArray[np.float64]

SETTLING_TIME = 0.03  # s after a jump of the command that are left out: spool, hose and clock act there, not the map
MIN_DURATION = 0.03  # s that a stretch must last beyond that
MIN_SAMPLES = 4  # samples of a stretch
MAX_SUBSTEPS = 50  # of one sample
MIN_COMMAND_JUMP = 0.005  # of the command's range in one sample
AVERAGING_RATIO = (
    0.02  # of the time that the steepest curve would take through its range: over that it is nearly straight
)
MIN_AVERAGED_SAMPLES = 8  # samples that every stretch keeps where readings are averaged
MAX_AVERAGING_TIME = 0.1  # s, at most, over which they are
SUPPLY_AVERAGING_TIME = 0.1  # s over which the supply's reading is averaged: a buffer vessel is slower, noise is not


@dataclass(frozen=True)
class Transients:
    """``L`` stretches of up to ``N`` samples: arrays of shape ``(N, L)``, padded where ``valid`` is False.

    ``u`` in V, ``supply`` and ``p`` in Pa; ``memory_gradient`` ``(N, L, 1 + k)`` in Pa/s, what the model's memory adds
    to dp/dt and its derivatives to the trend's k parameters (k = 0 without memory); ``time`` in s; ``period`` (s),
    ``recording`` (index) and ``averaged_readings``, of how many readings a sample is the mean, have shape ``(L,)``.
    ``substeps`` of one sample are small against the curves' own time; ``max_slope`` is the largest slope in Pa/s that
    they show, noise and all.
    """

    time: Array
    u: Array
    supply: Array
    p: Array
    memory_gradient: Array
    valid: NDArray[np.bool_]
    period: Array
    recording: NDArray[np.int64]
    averaged_readings: NDArray[np.int64]
    substeps: int
    max_slope: float

    def select(self, which: NDArray[np.int64]) -> Transients:
        """Return some of the stretches, as long as the longest of them."""
        longest = int(self.lengths[which].max(initial=1))
        cut = {f.name: getattr(self, f.name) for f in fields(self)}
        sides = {n: a[:longest, which] if a.ndim > 1 else a[which] for n, a in cut.items() if isinstance(a, np.ndarray)}
        return Transients(**{**cut, **sides})

    @property
    def lengths(self) -> NDArray[np.int64]:
        """How many samples each stretch has, (L,)."""
        last = self.valid[::-1].argmax(axis=0)
        return np.where(self.valid.any(axis=0), len(self.valid) - last, 0)

    def batches(self, samples: int) -> Iterator[NDArray[np.int64]]:
        """Yield which stretches, (l,), to take together: of like length, that many samples or one stretch."""
        lengths = np.maximum(self.lengths, 1)
        rest = np.argsort(-lengths, kind="stable")
        while rest.size:
            some = max(1, samples // int(lengths[rest[0]]))
            yield np.sort(rest[:some])
            rest = rest[some:]


@dataclass(frozen=True)
class _Segment:
    """One stretch: index of its recording, rows time, u, supply, p, beside, the time between readings."""

    recording: int
    rows: Array
    period: float

    @property
    def length(self) -> float:
        """Its length in s."""
        return float(self.rows.shape[1] * self.period)


def cut_transients(
    recordings: Sequence[Recording], supply_pressure: float | None, memory_gradients: Sequence[Array]
) -> Transients:
    """Return all stretches between jumps of the command; raise InputError where a signal is missing or none lasts.

    ``memory_gradients``: of each recording what the model's memory adds to dp/dt and its derivatives, ``(1 + k, n)`` in
    Pa/s. Readings are averaged as far as the curves are nearly straight, since the work goes with their number.
    """
    jobs = enumerate(zip(recordings, memory_gradients, strict=True))
    pieces = [piece for k, (r, more) in jobs for piece in _segments(k, r, supply_pressure, more)]
    if not pieces:
        raise InputError(
            "valve recordings",
            f"no command is held longer than {1e3 * (SETTLING_TIME + MIN_DURATION):.0f} ms",
            "charge and discharge curves at constant commands",
            "record steps or staircases of u",
        )
    shortest = min(piece.length for piece in pieces) / MIN_AVERAGED_SAMPLES
    steepest = max(_max_slope(piece, min(shortest, MIN_DURATION)) for piece in pieces)
    every = np.concatenate([piece.rows[3] for piece in pieces])
    straight = AVERAGING_RATIO * float(np.nanmax(every) - np.nanmin(every)) / steepest
    joined = [max(1, round(min(straight, shortest, MAX_AVERAGING_TIME) / piece.period)) for piece in pieces]
    rows = [average_readings(piece.rows, n) for piece, n in zip(pieces, joined, strict=True)]
    longest = max(one.shape[1] for one in rows)
    padded = np.stack([np.pad(one, ((0, 0), (0, longest - one.shape[1])), mode="edge") for one in rows], axis=-1)
    time, u, supply, p = padded[:4]
    valid = (np.arange(longest)[:, None] < np.array([one.shape[1] for one in rows])) & np.isfinite(p)
    period = np.array([n * piece.period for piece, n in zip(pieces, joined, strict=True)])
    return Transients(
        *(time, u, supply, p, np.moveaxis(padded[4:], 0, -1), valid, period),
        recording=np.array([piece.recording for piece in pieces], dtype=np.int64),
        averaged_readings=np.array(joined, dtype=np.int64),
        substeps=int(np.clip(np.ceil(period.max() / max(straight, 1e-9) - 1e-9), 1, MAX_SUBSTEPS)),
        max_slope=steepest,
    )


def _max_slope(piece: _Segment, span: float) -> float:
    """Return the largest slope of the means over a span in s, in Pa/s; at least 1."""
    joined = max(1, round(span / piece.period))
    slope = np.abs(np.diff(average_readings(piece.rows, joined)[3])) / (joined * piece.period)
    return max(float(np.nanmax(slope, initial=0.0)), 1.0)


def _segments(index: int, recording: Recording, supply_pressure: float | None, beside: Array) -> list[_Segment]:
    """Return the stretches of one recording."""
    for signal in ("u", "p1"):
        if signal not in recording:
            raise InputError(f"recording {recording.name}", f"no signal {signal}", "u and p1", "see [signals]")
    dt, noise, off = recording.period, recording.noise.get("p1"), interpolation_error(recording, "p1")
    if off > MAX_RESAMPLING_ERROR * (noise.rms if noise else 0.0):
        found = f"sampled unevenly, and too slowly to be resampled: p1 would err by {off:.2g} Pa, which shows"
        mend = "record it faster, or leave it to the fit of the model"
        raise InputError(f"recording {recording.name}", found, "even sampling, or faster", mend)
    rows = np.stack(
        [recording.time, recording["u"], _supply_pressure(recording, supply_pressure), recording["p1"], *beside]
    )
    rows = resample(rows, dt) if is_unevenly_sampled(recording) else rows
    u = rows[1]
    jumps = np.flatnonzero(np.abs(np.diff(u)) > MIN_COMMAND_JUMP * max(np.ptp(u), 1e-9)) + 1
    starts, stops = np.append(0, jumps), np.append(jumps, u.size)
    settling, shortest = round(SETTLING_TIME / dt), max(MIN_SAMPLES, round(MIN_DURATION / dt))
    begins = starts + settling * (starts > 0)
    spans = [(a, b) for a, b in zip(begins, stops, strict=True) if b - a >= shortest]
    return [_Segment(index, rows[:, a:b], dt) for a, b in spans if np.isfinite(rows[3, a:b]).any()]


def average_readings(rows: Array, readings: int) -> Array:
    """Return rows time, u, ... with ``readings`` readings in one; the command as it stands midway to the next mean.

    NaN where more than half of the readings are missing.
    """
    blocks = rows[:, : rows.shape[1] // readings * readings].reshape(len(rows), -1, readings)
    known = np.isfinite(blocks)
    count = known.sum(axis=-1)
    out = np.where(known, blocks, 0.0).sum(axis=-1) / np.maximum(count, 1)
    out[1] = blocks[1, :, -1]
    return np.asarray(np.where(2 * count < readings, np.nan, out))


def _supply_pressure(recording: Recording, supply_pressure: float | None) -> Array:
    if "p_supply" in recording:
        window = max(1, round(SUPPLY_AVERAGING_TIME / recording.period))
        return np.asarray(uniform_filter1d(recording["p_supply"], window, mode="nearest"), dtype=np.float64)
    if supply_pressure is None:
        raise InputError(
            f"recording {recording.name}", "no signal p_supply", "a supply pressure", "set rig.supply_pressure"
        )
    return np.full(recording.time.size, supply_pressure)
