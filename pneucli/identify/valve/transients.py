"""Transients: segments of valve recordings at a settled command, stacked for one simulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np

from pneucli.arrays import Array, Integers, Mask
from pneucli.errors import InputError
from pneucli.messages.formatting import format_quantity
from pneucli.recording import Recording

MAX_JITTER_RATIO = 0.1  # median departure of the steps from the period, over it: jitter and a few gaps stay below
# rms error of a straight line between readings, over its largest error for readings twice as far apart
INTERPOLATION_ERROR_RATIO = 30.0**-0.5
MAX_RESAMPLING_ERROR = 1 / 3  # of the noise: resampling then adds 5 % to the noise
LEAVE_ONE_OUT_VARIANCE = 1.5  # variances of the noise: a reading minus the mean of its neighbours has 1 + 1/2
SETTLING_TIME = 0.03  # s left out after a jump of the command, where spool, hose and clock dominate
MIN_DURATION = 0.03  # s that a transient lasts after that
MIN_SAMPLES = 4  # samples of a transient
MAX_SUBSTEPS = 50  # of one sample
MIN_COMMAND_JUMP = 0.005  # of the command's range in one sample
AVERAGING_RATIO = 0.02  # of the range over the steepest slope: over that time the curve is nearly straight
MIN_AVERAGED_SAMPLES = 8  # averaged samples of the shortest transient
MAX_AVERAGING_TIME = 0.1  # s
SUPPLY_AVERAGING_TIME = 0.1  # s: a buffer vessel changes more slowly than that, noise does not


@dataclass(frozen=True)
class Transients:
    """``L`` transients of up to ``N`` samples: arrays of shape ``(N, L)``, padded where ``valid`` is False.

    ``u`` in V, ``supply`` and ``p`` in Pa; ``memory_gradient`` ``(N, L, 1 + k)`` in Pa/s is the contribution of the
    model's memory to dp/dt and its derivatives by the k parameters of the model (k = 0 without memory); ``time`` in s;
    ``period`` (s), ``recording`` (index) and ``averaged_readings`` (number of readings in a sample) have shape
    ``(L,)``. ``substeps`` of one sample are short against the time constant of the curves; ``max_slope`` is the largest
    measured slope in Pa/s, noise included.
    """

    time: Array
    u: Array
    supply: Array
    p: Array
    memory_gradient: Array
    valid: Mask
    period: Array
    recording: Integers
    averaged_readings: Integers
    substeps: int
    max_slope: float

    def select(self, indices: Integers) -> Transients:
        """Return the transients of these indices, as long as the longest of them."""
        longest = int(self.lengths[indices].max(initial=1))
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        selected = {
            n: a[:longest, indices] if a.ndim > 1 else a[indices]
            for n, a in arrays.items()
            if isinstance(a, np.ndarray)
        }
        return Transients(**{**arrays, **selected})

    @property
    def lengths(self) -> Integers:
        """The number of samples of each transient, (L,)."""
        last = self.valid[::-1].argmax(axis=0)
        return np.where(self.valid.any(axis=0), len(self.valid) - last, 0)

    def batches(self, samples: int) -> Iterator[Integers]:
        """Yield the indices of transients of similar length, of up to ``samples`` samples or one transient."""
        lengths = np.maximum(self.lengths, 1)
        remaining = np.argsort(-lengths, kind="stable")
        while remaining.size:
            count = max(1, samples // int(lengths[remaining[0]]))
            yield np.sort(remaining[:count])
            remaining = remaining[count:]


@dataclass(frozen=True)
class _Segment:
    """One segment: index of its recording; rows of time, u, supply, p and memory; the period in s."""

    recording: int
    rows: Array
    period: float

    @property
    def length(self) -> float:
        """Its duration in s."""
        return float(self.rows.shape[1] * self.period)


def cut_transients(
    recordings: Sequence[Recording], supply_pressure: float | None, memory_gradients: Sequence[Array]
) -> Transients:
    """Cut recordings into transients at a settled command.

    Readings are averaged as far as the curves remain nearly straight, since the cost grows with their number.

    Args:
        recordings: The valve recordings.
        supply_pressure: Supply pressure in Pa, where it was not recorded.
        memory_gradients: For each recording the contribution of the model's memory to dp/dt and its derivatives, shape
            ``(1 + k, n)``, in Pa/s.

    Returns:
        The transients.

    Raises:
        InputError: A signal is missing, the sampling is too slow and uneven, or no command is held long enough.

    References:
        Thesis 7.4: charge and discharge of a vessel at each voltage.
    """
    jobs = enumerate(zip(recordings, memory_gradients, strict=True))
    segments = [segment for k, (r, more) in jobs for segment in _segments(k, r, supply_pressure, more)]
    if not segments:
        raise InputError(
            "valve recordings",
            f"no command is held longer than {1e3 * (SETTLING_TIME + MIN_DURATION):.0f} ms",
            "charge and discharge curves at constant commands",
            "record steps or staircases of u",
            code="E062",
        )
    shortest = min(segment.length for segment in segments) / MIN_AVERAGED_SAMPLES
    steepest = max(_max_slope(segment, min(shortest, MIN_DURATION)) for segment in segments)
    all_pressures = np.concatenate([segment.rows[3] for segment in segments])
    straight_time = AVERAGING_RATIO * float(np.nanmax(all_pressures) - np.nanmin(all_pressures)) / steepest
    readings_per_sample = [
        max(1, round(min(straight_time, shortest, MAX_AVERAGING_TIME) / segment.period)) for segment in segments
    ]
    rows = [average_readings(segment.rows, n) for segment, n in zip(segments, readings_per_sample, strict=True)]
    longest = max(row_block.shape[1] for row_block in rows)
    padded = np.stack(
        [np.pad(row_block, ((0, 0), (0, longest - row_block.shape[1])), mode="edge") for row_block in rows], axis=-1
    )
    time, u, supply, p = padded[:4]
    valid = (np.arange(longest)[:, None] < np.array([row_block.shape[1] for row_block in rows])) & np.isfinite(p)
    period = np.array([n * segment.period for segment, n in zip(segments, readings_per_sample, strict=True)])
    return Transients(
        *(time, u, supply, p, np.moveaxis(padded[4:], 0, -1), valid, period),
        recording=np.array([segment.recording for segment in segments], dtype=np.int64),
        averaged_readings=np.array(readings_per_sample, dtype=np.int64),
        substeps=int(np.clip(np.ceil(period.max() / max(straight_time, 1e-9) - 1e-9), 1, MAX_SUBSTEPS)),
        max_slope=steepest,
    )


def _max_slope(segment: _Segment, span: float) -> float:
    """Return the largest slope of means over a time span (s) in Pa/s; at least 1."""
    readings_per_sample = max(1, round(span / segment.period))
    slope = np.abs(np.diff(average_readings(segment.rows, readings_per_sample)[3])) / (
        readings_per_sample * segment.period
    )
    return max(float(np.nanmax(slope, initial=0.0)), 1.0)


def _segments(index: int, recording: Recording, supply_pressure: float | None, memory: Array) -> list[_Segment]:
    """Return the segments of one recording at a settled command."""
    for signal in ("u", "p1"):
        if signal not in recording:
            raise InputError(
                f"recording {recording.name}", f"no signal {signal}", "u and p1", "see [signals]", code="E060"
            )
    dt, noise, error = recording.period, recording.noise.get("p1"), interpolation_error(recording, "p1")
    if error > MAX_RESAMPLING_ERROR * (noise.rms if noise else 0.0):
        size = format_quantity(error, "Pa", 2)
        fault = f"sampled unevenly, and too slowly to be resampled: p1 would err by {size}, which shows"
        mend = "record it faster, or leave it to the fit of the model"
        raise InputError(f"recording {recording.name}", fault, "even sampling, or faster", mend, code="E045")
    rows = np.stack(
        [recording.time, recording["u"], _supply_pressure(recording, supply_pressure), recording["p1"], *memory]
    )
    rows = _resample(rows, dt) if is_unevenly_sampled(recording) else rows
    u = rows[1]
    jumps = np.flatnonzero(np.abs(np.diff(u)) > MIN_COMMAND_JUMP * max(np.ptp(u), 1e-9)) + 1
    starts, stops = np.append(0, jumps), np.append(jumps, u.size)
    settling, shortest = round(SETTLING_TIME / dt), max(MIN_SAMPLES, round(MIN_DURATION / dt))
    settled_starts = starts + settling * (starts > 0)
    spans = [(a, b) for a, b in zip(settled_starts, stops, strict=True) if b - a >= shortest]
    return [_Segment(index, rows[:, a:b], dt) for a, b in spans if np.isfinite(rows[3, a:b]).any()]


def average_readings(rows: Array, readings: int) -> Array:
    """Average consecutive readings.

    Args:
        rows: Time, command and further signals, shape (m, n).
        readings: Number of readings in an average.

    Returns:
        The averages; the command is that of the last reading, which holds until the next average. NaN where more than
        half of the readings are missing.

    """
    blocks = rows[:, : rows.shape[1] // readings * readings].reshape(len(rows), -1, readings)
    finite = np.isfinite(blocks)
    count = finite.sum(axis=-1)
    out = np.where(finite, blocks, 0.0).sum(axis=-1) / np.maximum(count, 1)
    out[1] = blocks[1, :, -1]
    return np.asarray(np.where(2 * count < readings, np.nan, out))


def _supply_pressure(recording: Recording, supply_pressure: float | None) -> Array:
    from scipy.ndimage import uniform_filter1d  # noqa: PLC0415 - slow to import, and few recordings have a supply pressure

    if "p_supply" in recording:
        window = max(1, round(SUPPLY_AVERAGING_TIME / recording.period))
        return np.asarray(uniform_filter1d(recording["p_supply"], window, mode="nearest"), dtype=np.float64)
    if supply_pressure is None:
        raise InputError(
            f"recording {recording.name}",
            "no signal p_supply",
            "a supply pressure",
            "set rig.supply_pressure",
            code="E060",
        )
    return np.full(recording.time.size, supply_pressure)


def is_unevenly_sampled(recording: Recording) -> bool:
    """Return whether the stamps depart from one period by more than jitter.

    Args:
        recording: The recording.

    Returns:
        Whether the median departure exceeds ``MAX_JITTER_RATIO`` of the period.

    """
    steps = np.diff(recording.time)
    return float(np.median(np.abs(steps - recording.period))) > MAX_JITTER_RATIO * recording.period


def interpolation_error(recording: Recording, signal: str) -> float:
    """Estimate the rms error of straight lines between the readings of a signal.

    Each reading is left out and interpolated from its neighbours: the difference is the curvature over twice the
    distance plus noise, whose variance is subtracted.

    Args:
        recording: The recording.
        signal: Name of the signal.

    Returns:
        The error in the signal's SI unit; 0 for an even clock.

    """
    if not is_unevenly_sampled(recording):
        return 0.0
    finite = np.isfinite(recording[signal])
    time, y = recording.time[finite], recording[signal][finite]
    if y.size < 3:
        return np.inf
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    interpolation_residual = y[1:-1] - y[:-2] - share * (y[2:] - y[:-2])
    noise = recording.noise.get(signal)
    excess = float(np.mean(interpolation_residual**2)) - LEAVE_ONE_OUT_VARIANCE * (noise.rms**2 if noise else 0.0)
    return float(INTERPOLATION_ERROR_RATIO * max(excess, 0.0) ** 0.5)


def _resample(rows: Array, period: float) -> Array:
    """Resample rows to an even clock: the command is held, all other signals are interpolated linearly.

    >>> rows = np.array([[0.0, 1.0, 3.0], [5.0, 6.0, 7.0], [0.0, 10.0, 30.0]])
    >>> _resample(rows, 1.5).tolist()  # time, held command, interpolated signal
    [[0.0, 1.5, 3.0], [5.0, 6.0, 7.0], [0.0, 15.0, 30.0]]
    """
    time, u, *others = rows
    clock = np.arange(time[0], time[-1] + period / 2, period)
    held_command = u[np.searchsorted(time, clock + period * 1e-6, side="right") - 1]
    return np.stack([clock, held_command, *(np.interp(clock, time, row) for row in others)])
